/// A drawing as SVG text, with the features that Berth's plots need. Lengths are in pixels, y grows downwards; words
/// are escaped.
#pragma once

#include <string>
#include <string_view>

namespace berth {

class Svg {
 public:
  /// The background is white.
  Svg(double width, double height);

  /// `anchor`: which point of the text is at `x`: "start", "middle" or "end".
  void words(double x, double y, const char* anchor, std::string_view text, int size = 11);
  void line(double x1, double y1, double x2, double y2, const char* colour, double thick = 1);
  void rectangle(double x, double y, double width, double height, const char* fill);
  void circle(double x, double y, double radius, const char* fill, const char* stroke);
  /// `points`: "x,y x,y ..."; `dashes`: as in stroke-dasharray, empty: none.
  void curve(std::string_view points, const char* colour, double thick, std::string_view dashes = {});

  [[nodiscard]] std::string text() const { return text_ + "</svg>\n"; }

 private:
  std::string text_;
};

/// Okabe and Ito's colours, which most people can distinguish, and colours for a plot's background.
namespace colour {
inline constexpr const char *orange = "#E69F00", *sky = "#56B4E9", *green = "#009E73", *yellow = "#F0E442",
                            *blue = "#0072B2", *vermilion = "#D55E00", *purple = "#CC79A7", *black = "#000000",
                            *grid = "#DDDDDD";
}

}  // namespace berth
