#include "eval/plot_script.h"

#include <cstdio>

namespace raceloc {

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

std::string svgTerminal(const std::string& name, int height_px) {
  return "set terminal svg size " + std::to_string(kPicture_px) + "," + std::to_string(height_px) +
         " name '" + name +
         "' font 'DejaVu Sans,Arial,sans-serif' fontscale 0.95 background 'white' noenhanced\n"
         "set border lc rgb '#606060'\nset tics nomirror\nset grid lc rgb '#E0E0E0' lt 1 lw 0.7\n"
         "set format '%.10g'\n";
}

}  // namespace raceloc
