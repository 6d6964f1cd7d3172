/** \file
 * Pictures as gnuplot scripts, and what all of them share. */
#pragma once

#include <string>

namespace raceloc {

constexpr int kPicture_px = 900;  ///< width

// Okabe and Ito's colours, told apart by the colour-blind too.
constexpr char kBlue[] = "#0072B2";
constexpr char kGreen[] = "#009E73";
constexpr char kVermillion[] = "#D55E00";
constexpr char kGrey[] = "#CFCFCF";

/** The terminal and the look. \param name  tells the ids of one picture from those of another in the same page */
[[nodiscard]] std::string svgTerminal(const std::string& name, int height_px);

/** A picture that is not drawn yet. */
struct Picture {
  std::string name;   ///< of a file, and of the ids in a page: "by_station"
  std::string title;  ///< plain text, above it in a page
  int height_px;
  std::string
      script;  ///< for gnuplot, without terminal; all curves in one plot, so that a page can tell their values
};

enum class PictureFormat {
  svg,   ///< a file for papers
  page,  ///< SVG inside a page, with gnuplot's own script: a click shows the values under the pointer, one on the key hides a curve
  png    ///< a file of twice the pixels
};

/** Drawn by the program gnuplot: no display, the same bytes for the same script.
 * \throws InputError if gnuplot is not installed. */
[[nodiscard]] std::string drawn(const Picture& picture, PictureFormat format);

/** Of a file's name. \throws InputError unless it ends in .svg or .png */
[[nodiscard]] PictureFormat formatOf(const std::string& path);

}  // namespace raceloc
