#include "berth/base/svg.hpp"

#include <fmt/format.h>

#include <iterator>

#include "berth/base/words.hpp"

namespace berth {

Svg::Svg(double width, double height)
    : text_(fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
                        "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"sans-serif\">\n"
                        "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
                        width, height)) {}

void Svg::words(double x, double y, const char* anchor, std::string_view text, int size) {
  fmt::format_to(std::back_inserter(text_),
                 "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" font-size=\"{}\">{}</text>\n", x, y, anchor, size,
                 markup(std::string(text)));
}

void Svg::line(double x1, double y1, double x2, double y2, const char* colour, double thick) {
  fmt::format_to(std::back_inserter(text_),
                 "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" "
                 "stroke-width=\"{:g}\"/>\n",
                 x1, y1, x2, y2, colour, thick);
}

void Svg::rectangle(double x, double y, double width, double height, const char* fill) {
  fmt::format_to(std::back_inserter(text_),
                 "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>\n", x, y, width,
                 height, fill);
}

void Svg::circle(double x, double y, double radius, const char* fill, const char* stroke) {
  fmt::format_to(std::back_inserter(text_),
                 "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:g}\" fill=\"{}\" stroke=\"{}\"/>\n", x, y, radius, fill,
                 stroke);
}

void Svg::curve(std::string_view points, const char* colour, double thick, std::string_view dashes) {
  fmt::format_to(std::back_inserter(text_),
                 "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"{:g}\"{} points=\"{}\"/>\n", colour, thick,
                 dashes.empty() ? std::string() : fmt::format(" stroke-dasharray=\"{}\"", dashes), points);
}

}  // namespace berth
