/** \file
 * What the gnuplot scripts of all pictures share. */
#pragma once

#include <string>

namespace raceloc {

constexpr int kPicture_px = 900;  ///< width

// Okabe and Ito's colours, told apart by the colour-blind too.
constexpr char kBlue[] = "#0072B2";
constexpr char kGreen[] = "#009E73";
constexpr char kVermillion[] = "#D55E00";
constexpr char kGrey[] = "#CFCFCF";

[[nodiscard]] std::string number(double value);

/** The terminal and the look. \param name  tells the ids of one picture from those of another in the same page */
[[nodiscard]] std::string svgTerminal(const std::string& name, int height_px);

}  // namespace raceloc
