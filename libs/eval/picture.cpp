#include "eval/picture.h"

#include <cstdio>

#include "core/errors.h"
#include "eval/gnuplot.h"

namespace raceloc {

namespace {

constexpr char kLook[] =
    "set border lc rgb '#606060'\nset tics nomirror\nset grid lc rgb '#E0E0E0' lt 1 lw 0.7\n"
    "set format '%.10g'\n";

std::string svg(const std::string& name, int height_px, const std::string& more) {
  return "set terminal svg size " + std::to_string(kPicture_px) + "," + std::to_string(height_px) +
         " name '" + name + "'" + more +
         " font 'DejaVu Sans,Arial,sans-serif' fontscale 0.95 background 'white' noenhanced\n" + kLook;
}

/** A page is read on a screen, a PNG is put into a paper: twice the pixels, and all that is drawn twice as large. */
std::string png(int height_px) {
  return "set terminal pngcairo size " + std::to_string(2 * kPicture_px) + "," +
         std::to_string(2 * height_px) +
         " font 'DejaVu Sans,12' fontscale 1.5 linewidth 2 pointscale 2 background 'white' noenhanced\n" +
         kLook;
}

bool endsIn(const std::string& path, const std::string& ending) {
  return path.size() > ending.size() && path.compare(path.size() - ending.size(), ending.size(), ending) == 0;
}

}  // namespace

std::string svgTerminal(const std::string& name, int height_px) { return svg(name, height_px, ""); }

std::string drawn(const Picture& picture, PictureFormat format) {
  switch (format) {
    case PictureFormat::page:
      return gnuplot(svg(picture.name, picture.height_px, " mousing standalone") + picture.script);
    case PictureFormat::png:
      return gnuplot(png(picture.height_px) + picture.script);
    case PictureFormat::svg:
      break;
  }
  return gnuplot(svgTerminal(picture.name, picture.height_px) + picture.script);
}

PictureFormat formatOf(const std::string& path) {
  if (endsIn(path, ".svg")) return PictureFormat::svg;
  if (endsIn(path, ".png")) return PictureFormat::png;
  throw InputError("picture " + path + ": its name must end in .svg or .png");
}

}  // namespace raceloc
