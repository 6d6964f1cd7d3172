/** \file
 * What a map builder reads beside the map: a page for people, figures for programs. */
#pragma once

#include <string>

#include "pipeline/map_qa.h"

namespace raceloc {

/** One page without links to anywhere: verdict, limits, pictures, lists. Where gnuplot is not installed, it says so in
 * place of the pictures. \param title  name of the map */
[[nodiscard]] std::string qaPage(const std::string& title, const BuiltMap& built, const QaResult& qa,
                                 const QaOptions& options);

/** Every figure, keys with their units. */
[[nodiscard]] std::string qaJson(const BuiltMap& built, const QaResult& qa);

}  // namespace raceloc
