/** \file
 * What the localizer thinks of its own run, as tables for raceloc-eval. The first line names the columns. */
#pragma once

#include <deque>
#include <fstream>
#include <string>

#include "core/output_file.h"
#include "pipeline/localizer.h"

namespace raceloc {

/** A table that grows with the run and appears under its name with commit() only. */
class RunCsv {
 public:
  virtual ~RunCsv() = default;
  RunCsv(const RunCsv&) = delete;
  RunCsv& operator=(const RunCsv&) = delete;
  virtual void write(const LocalizerOutput& output) = 0;
  virtual void commit();
  [[nodiscard]] const std::string& path() const { return x_file.path(); }

 protected:
  /** \throws InputError if the file cannot be written. */
  RunCsv(const std::string& path, const char* columns);
  std::ofstream& stream() { return x_stream; }

 private:
  OutputFile x_file;
  std::ofstream x_stream;
};

/** A line an estimate: stamp [s], state (0 ok, 1 degraded, 2 dead reckoning, 3 lost), what was measured and its limit,
 * protection levels [m, m, rad], alert limit [m], covariance of the error along, across and about the vertical in the car's
 * axes (upper triangle, row by row) [m^2, m rad, rad^2], cause. */
class IntegrityCsv : public RunCsv {
 public:
  explicit IntegrityCsv(const std::string& path);
  void write(const LocalizerOutput& output) override;
};

/** A line a source a decision of the gate: its stamp [s], rule (1..4, see GateRule), alarm, reset, and of the source the
 * innovation along and across the car's heading [m] and what SourceVerdict says. Its label is quoted.
 * Decisions stand as they were made last, with what came late; so they are held back for longer than any lag. */
class DecisionCsv : public RunCsv {
 public:
  explicit DecisionCsv(const std::string& path);
  void write(const LocalizerOutput& output) override;
  void commit() override;

 private:
  void writeBefore(double stamp_s);

  std::deque<DatedDecision> x_pending;
};

/** A line a match that an output carries: stamp of its end of sweep, and the wall time [s] from its last point to its pose, preparation and match. No two
 * runs share it. */
class LatencyCsv : public RunCsv {
 public:
  explicit LatencyCsv(const std::string& path);
  void write(const LocalizerOutput& output) override;
};

}  // namespace raceloc
