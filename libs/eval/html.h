/** \file
 * A page of figures and pictures without links to anywhere. */
#pragma once

#include <string>
#include <vector>

#include "eval/picture.h"

namespace raceloc {

/** The whole page. \param title  as plain text \param body  HTML below the title */
[[nodiscard]] std::string htmlPage(const std::string& title, const std::string& body);

[[nodiscard]] std::string escaped(const std::string& text);  ///< plain text as HTML

/** A row of a table. \param tag  of its cells: "td" or "th" \param cells  plain text */
[[nodiscard]] std::string htmlRow(const char* tag, const std::vector<std::string>& cells);

/** What of an SVG file may stand inside a page. */
[[nodiscard]] std::string inlinedSvg(const std::string& svg);

/** Pictures below their titles, to be looked into with the mouse.
 * \throws InputError if gnuplot is not installed. */
[[nodiscard]] std::string htmlPictures(const std::vector<Picture>& pictures);

}  // namespace raceloc
