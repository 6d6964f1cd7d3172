#include "pipeline/integrity_csv.h"

#include <cstdio>

namespace raceloc {

namespace {

/** A field as RFC 4180 has it: labels in a cause may hold commas. */
std::string quoted(const std::string& text) {
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? std::string("\"\"") : std::string(1, c);
  return field + '"';
}

}  // namespace

IntegrityCsv::IntegrityCsv(const std::string& path) : x_file(path), x_stream(x_file.temporaryPath()) {
  x_stream
      << "stamp_s,state,measured,limit,protection_lateral_m,protection_longitudinal_m,protection_heading_rad,"
         "alert_limit_m,var_along_m2,cov_along_across_m2,cov_along_heading_m_rad,var_across_m2,"
         "cov_across_heading_m_rad,var_heading_rad2,cause\n";
}

void IntegrityCsv::write(const LocalizerOutput& output) {
  const Integrity& i = output.integrity;
  const Matrix6d& C = output.covariance;
  char line[400];
  std::snprintf(line, sizeof line, "%.6f,%d,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,",
                output.stamp_s, static_cast<int>(i.state), i.measured, i.limit, i.protection.lateral_m,
                i.protection.longitudinal_m, i.protection.heading_rad, i.alert_limit_m, C(3, 3), C(3, 4),
                C(3, 2), C(4, 4), C(4, 2), C(2, 2));
  x_stream << line << quoted(i.cause) << '\n';
}

void IntegrityCsv::commit() {
  x_stream.close();
  if (!x_stream) throw cannotWrite(x_file.path());
  x_file.commit();
}

}  // namespace raceloc
