#include "eval/html.h"

namespace raceloc {

namespace {

constexpr char kStyle[] = R"(<style>
body { font: 15px/1.45 "DejaVu Sans", Arial, sans-serif; color: #222; max-width: 920px; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.5em } h2 { font-size: 1.1em; margin: 1.8em 0 .4em }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
td, th { padding: .2em .9em .2em 0; text-align: right; border-bottom: 1px solid #ddd; font-weight: normal }
th { color: #666 } td:first-child, th:first-child { text-align: left }
table.words td, table.words th { text-align: left } p.note { color: #666; font-size: .9em; margin: .4em 0 }
p.pass { border-left: 4px solid #009E73; padding: .3em .8em; background: #ecf7f2 }
p.warning { border-left: 4px solid #D55E00; padding: .3em .8em; background: #fdf3ec }
code { font-size: .9em; overflow-wrap: anywhere } svg { width: 100%; height: auto }
</style>
)";

// gnuplot's script takes every turn of the wheel over a picture for itself; a page is to be scrolled.
constexpr char kWheelScrolls[] =
    "<script>document.addEventListener('wheel', e => { if (!e.ctrlKey) e.stopPropagation(); }, "
    "true);</script>\n";
constexpr char kHowToLook[] =
    "click into a picture: values under the pointer; click on a curve's name: the curve goes and comes; Ctrl "
    "and wheel: "
    "zoom, then drag; right click: back";

}  // namespace

std::string htmlPage(const std::string& title, const std::string& body) {
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>" + escaped(title) +
         "</title>\n" + kStyle + "</head>\n<body>\n<h1>" + escaped(title) + "</h1>\n" + body +
         "</body>\n</html>\n";
}

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '&') {
      safe += "&amp;";
    } else if (c == '<') {
      safe += "&lt;";
    } else if (c == '>') {
      safe += "&gt;";
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string htmlRow(const char* tag, const std::vector<std::string>& cells) {
  std::string row = "<tr>";
  for (const auto& cell : cells) row += std::string("<") + tag + ">" + escaped(cell) + "</" + tag + ">";
  return row + "</tr>\n";
}

std::string inlinedSvg(const std::string& svg) {
  const auto start = svg.find("<svg");
  return start == std::string::npos ? svg : svg.substr(start);
}

std::string htmlPictures(const std::vector<Picture>& pictures) {
  std::string html = std::string(kWheelScrolls) + "<p class=\"note\">" + kHowToLook + "</p>\n";
  for (const Picture& picture : pictures)
    html += "<h2>" + escaped(picture.title) + "</h2>\n" + inlinedSvg(drawn(picture, PictureFormat::page));
  return html;
}

}  // namespace raceloc
