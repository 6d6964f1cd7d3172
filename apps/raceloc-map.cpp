#include "cli/app.h"
#include "cli/map_args.h"

int main(int argc, char** argv) {
  return raceloc::runApp("raceloc-map", [&] {
    if (const auto args = raceloc::parseMapArgs(argc, argv)) raceloc::runMap(*args);
  });
}
