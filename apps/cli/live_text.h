/** \file
 * What raceloc-live prints of a run. */
#pragma once

#include "fusion/estimator.h"
#include "pipeline/replay.h"

namespace raceloc {

void print(const ReplayReport& r);
void print(const OdometryReport& r);
/** How often the gate throws out a source whose errors are what it claims. */
void printFalseRejects(const EstimatorOptions& options);

}  // namespace raceloc
