/** \file
 * Foreign recordings in, a rawlog out. */
#include <iostream>

#include "cli/app.h"
#include "cli/import_args.h"

int main(int argc, char** argv) {
  return raceloc::runApp("raceloc-import", [&] {
    const auto args = raceloc::parseImportArgs(argc, argv);
    if (!args) return;
    const auto summary = raceloc::runImport(*args);
    std::cout << args->log_path << "\n" << raceloc::toText(summary) << std::flush;
  });
}
