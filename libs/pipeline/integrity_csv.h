/** \file
 * What the localizer thinks of its own estimates, a line each, for raceloc-eval. */
#pragma once

#include <fstream>
#include <string>

#include "core/output_file.h"
#include "pipeline/localizer.h"

namespace raceloc {

/** Its first line names the columns: stamp [s], state (0 ok, 1 degraded, 2 dead reckoning, 3 lost), what was measured and its
 * limit, protection levels [m, m, rad], alert limit [m], covariance of the error along, across and about the vertical in
 * the car's axes (upper triangle, row by row) [m^2, m rad, rad^2], cause. */
class IntegrityCsv {
 public:
  /** \throws InputError if the file cannot be written. */
  explicit IntegrityCsv(const std::string& path);
  void write(const LocalizerOutput& output);
  void commit();

 private:
  OutputFile x_file;
  std::ofstream x_stream;
};

}  // namespace raceloc
