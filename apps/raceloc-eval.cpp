/** \file
 * Trajectories in, errors and pictures out. */
#include <iostream>

#include "cli/app.h"
#include "cli/eval_args.h"
#include "core/output_file.h"
#include "eval/plots.h"
#include "eval/report.h"

int main(int argc, char** argv) {
  return raceloc::runApp("raceloc-eval", [&] {
    const auto args = raceloc::parseEvalArgs(argc, argv);
    if (!args) return;
    const auto evaluation =
        raceloc::evaluate(raceloc::readTrajectoryFile(args->truth_path),
                          raceloc::readTrajectoryFile(args->estimate_path), args->options);
    std::cout << raceloc::textReport(evaluation) << std::flush;
    if (!args->csv_path.empty()) raceloc::writeTextFile(args->csv_path, raceloc::errorsCsv(evaluation));
    if (!args->json_path.empty()) raceloc::writeTextFile(args->json_path, raceloc::figuresJson(evaluation));
    if (!args->picture_path.empty())
      raceloc::writeTextFile(args->picture_path, raceloc::trajectoryPicture(evaluation));
    if (!args->report_path.empty())
      raceloc::writeTextFile(args->report_path, raceloc::htmlReport(evaluation, args->command));
  });
}
