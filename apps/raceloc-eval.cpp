/** \file
 * Trajectories in, errors and pictures out; and what a command costs. */
#include "cli/app.h"
#include "cli/eval_args.h"

int main(int argc, char** argv) {
  int status = 0;  // of the command that `cpu` ran
  const int failure = raceloc::runApp("raceloc-eval", [&] {
    if (const auto args = raceloc::parseEvalArgs(argc, argv)) status = raceloc::runEval(*args);
  });
  return failure != 0 ? failure : status;
}
