// The plot of `berth compare`: SVG is text, and this is all that it needs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "berth/study/contest.hpp"

namespace berth::study {
namespace {

constexpr double panel_width = 300, panel_height = 220, gap = 60, left = 70, top = 110;
// Okabe and Ito's colours, which most people can tell apart, and two greys.
constexpr const char* colours[]{"#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2",
                                "#D55E00", "#CC79A7", "#000000", "#777777", "#AA3377"};

/// A logarithmic axis from `low` to `high`, drawn from `begin` to `end`.
struct Axis {
  double low, high, begin, end;
  [[nodiscard]] double at(double value) const {
    if (high <= low) return (begin + end) / 2;
    return begin + (end - begin) * (std::log(value) - std::log(low)) / (std::log(high) - std::log(low));
  }
};

double seconds(const Cell& c) { return std::max(1e-4, std::chrono::duration<double>(c.bus_time).count()); }

template <class T, class Get>
std::vector<T> distinct(const std::vector<Cell>& cells, const Get& get) {
  std::vector<T> all;
  for (const auto& c : cells) {
    if (std::ranges::find(all, get(c)) == all.end()) all.push_back(get(c));
  }
  return all;
}

std::string text(double x, double y, const char* anchor, const std::string& words, int size = 11) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" font-size=\"{}\">{}</text>\n", x, y, anchor,
                     size, words);
}

std::string line(double x1, double y1, double x2, double y2, const char* colour) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"/>\n", x1, y1, x2, y2,
                     colour);
}

/// A hollow mark: not every device was bound.
std::string mark(double x, double y, const char* colour, bool whole) {
  return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\" stroke=\"{}\"/>\n", x, y,
                     whole ? colour : "white", colour);
}

class Panel {
 public:
  Panel(const std::vector<Cell>& cells, const Axis& x, const Axis& y) : cells_(cells), x_(x), y_(y) {}

  std::string frame(const std::string& title) const {
    std::string svg = text((x_.begin + x_.end) / 2, y_.end - 8, "middle", title, 12);
    for (const auto n : distinct<unsigned>(cells_, [](const Cell& c) { return c.devices; })) {
      svg += line(x_.at(n), y_.begin, x_.at(n), y_.end, "#DDDDDD");
      svg += text(x_.at(n), y_.begin + 14, "middle", std::to_string(n));
    }
    for (double t = y_.low; t <= y_.high * 1.001; t *= 10) {
      svg += line(x_.begin, y_.at(t), x_.end, y_.at(t), "#DDDDDD");
      svg +=
          text(x_.begin - 6, y_.at(t) + 4, "end", t < 1 ? fmt::format("{:g} ms", t * 1000) : fmt::format("{:g} s", t));
    }
    return svg + text((x_.begin + x_.end) / 2, y_.begin + 28, "middle", "devices");
  }

  std::string curve(const Contestant& method, std::uint32_t rate, Serials serials, const char* colour) const {
    std::string points, marks;
    for (const auto& c : cells_) {
      if (c.method != method || c.bit_rate != rate || c.serials != serials) continue;
      const double x = x_.at(c.devices), y = y_.at(seconds(c));
      points += fmt::format("{:.1f},{:.1f} ", x, y);
      marks += mark(x, y, colour, c.bound == c.devices);
    }
    return fmt::format("<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{} points=\"{}\"/>\n", colour,
                       is_planner(method) ? 2.5 : 1.5, is_planner(method) ? "" : " stroke-dasharray=\"5 3\"", points) +
           marks;
  }

 private:
  const std::vector<Cell>& cells_;
  Axis x_, y_;
};

/// Whole decades around all times.
std::pair<double, double> decades(const std::vector<Cell>& cells) {
  double low = 1e9, high = 1e-9;
  for (const auto& c : cells) {
    low = std::min(low, seconds(c));
    high = std::max(high, seconds(c));
  }
  return {std::pow(10, std::floor(std::log10(low))), std::pow(10, std::ceil(std::log10(high)))};
}

}  // namespace

std::string plot(const std::vector<Cell>& cells) {
  const auto rates = distinct<std::uint32_t>(cells, [](const Cell& c) { return c.bit_rate; });
  const auto kinds = distinct<Serials>(cells, [](const Cell& c) { return c.serials; });
  const auto methods = distinct<Contestant>(cells, [](const Cell& c) { return c.method; });
  const double width = left + static_cast<double>(kinds.size()) * (panel_width + gap);
  const double height = top + static_cast<double>(rates.size()) * (panel_height + gap + 20);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
      "font-family=\"sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
      width, height);
  svg += text(left, 24, "start", "Bus time to find blank devices and give each a node-ID", 16);
  svg += text(left, 42, "start", "solid: Berth's planners; dashed: published; hollow: not every device was bound");
  if (cells.empty()) return svg + "</svg>\n";
  for (std::size_t i = 0; i < methods.size(); ++i) {
    const double x = left + static_cast<double>(i % 5) * 175, y = 60 + static_cast<double>(i / 5) * 16;
    svg +=
        mark(x, y - 4, colours[i % std::size(colours)], true) + text(x + 8, y, "start", std::string(name(methods[i])));
  }
  const auto [fastest, slowest] = decades(cells);
  const auto devices = distinct<unsigned>(cells, [](const Cell& c) { return c.devices; });
  const auto [fewest, most] = std::ranges::minmax(devices);
  for (std::size_t row = 0; row < rates.size(); ++row) {
    for (std::size_t column = 0; column < kinds.size(); ++column) {
      const double x = left + static_cast<double>(column) * (panel_width + gap);
      const double y = top + static_cast<double>(row) * (panel_height + gap + 20);
      const Panel panel(cells, {double(fewest), double(most), x, x + panel_width},
                        {fastest, slowest, y + panel_height, y});
      svg += panel.frame(fmt::format("{} kbit/s, {} serial numbers", rates[row] / 1000, name(kinds[column])));
      for (std::size_t i = 0; i < methods.size(); ++i)
        svg += panel.curve(methods[i], rates[row], kinds[column], colours[i % std::size(colours)]);
    }
  }
  return svg + "</svg>\n";
}

}  // namespace berth::study
