#include "cli/app.h"
#include "cli/live_args.h"

int main(int argc, char** argv) {
  return raceloc::runApp("raceloc-live", [&] {
    if (const auto args = raceloc::parseLiveArgs(argc, argv)) raceloc::runLive(*args);
  });
}
