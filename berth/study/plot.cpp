// The plot of `berth compare`.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "berth/base/svg.hpp"
#include "berth/study/contest.hpp"

namespace berth::study {
namespace {

constexpr double panel_width = 300, panel_height = 220, gap = 60, left = 70, top = 110;
constexpr const char* colours[]{colour::orange,    colour::sky,    colour::green, colour::yellow, colour::blue,
                                colour::vermilion, colour::purple, colour::black, "#777777",      "#AA3377"};

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

/// A hollow mark: not every device was bound.
void mark(Svg& svg, double x, double y, const char* colour, bool whole) {
  svg.circle(x, y, 3, whole ? colour : "white", colour);
}

class Panel {
 public:
  Panel(const std::vector<Cell>& cells, const Axis& x, const Axis& y) : cells_(cells), x_(x), y_(y) {}

  void frame(Svg& svg, const std::string& title) const {
    svg.words((x_.begin + x_.end) / 2, y_.end - 8, "middle", title, 12);
    for (const auto n : distinct<unsigned>(cells_, [](const Cell& c) { return c.devices; })) {
      svg.line(x_.at(n), y_.begin, x_.at(n), y_.end, colour::grid);
      svg.words(x_.at(n), y_.begin + 14, "middle", std::to_string(n));
    }
    for (double t = y_.low; t <= y_.high * 1.001; t *= 10) {
      svg.line(x_.begin, y_.at(t), x_.end, y_.at(t), colour::grid);
      svg.words(x_.begin - 6, y_.at(t) + 4, "end", t < 1 ? fmt::format("{:g} ms", t * 1000) : fmt::format("{:g} s", t));
    }
    svg.words((x_.begin + x_.end) / 2, y_.begin + 28, "middle", "devices");
  }

  void curve(Svg& svg, const Contestant& method, std::uint32_t rate, Serials serials, const char* colour) const {
    std::string points;
    for (const auto& c : of(method, rate, serials)) {
      points += fmt::format("{:.1f},{:.1f} ", x_.at(c->devices), y_.at(seconds(*c)));
    }
    svg.curve(points, colour, is_planner(method) ? 2.5 : 1.5, is_planner(method) ? "" : "5 3");
    for (const auto& c : of(method, rate, serials)) {
      mark(svg, x_.at(c->devices), y_.at(seconds(*c)), colour, c->bound == c->devices);
    }
  }

 private:
  [[nodiscard]] std::vector<const Cell*> of(const Contestant& method, std::uint32_t rate, Serials serials) const {
    std::vector<const Cell*> these;
    for (const auto& c : cells_) {
      if (c.method == method && c.bit_rate == rate && c.serials == serials) these.push_back(&c);
    }
    return these;
  }

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
  Svg svg(width, height);
  svg.words(left, 24, "start", "Bus time to find blank devices and give each a node-ID", 16);
  svg.words(left, 42, "start", "solid: Berth's planners; dashed: published; hollow: not every device was bound");
  if (cells.empty()) return svg.text();
  for (std::size_t i = 0; i < methods.size(); ++i) {
    const double x = left + static_cast<double>(i % 5) * 175, y = 60 + static_cast<double>(i / 5) * 16;
    mark(svg, x, y - 4, colours[i % std::size(colours)], true);
    svg.words(x + 8, y, "start", name(methods[i]));
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
      panel.frame(svg, fmt::format("{} kbit/s, {} serial numbers", rates[row] / 1000, name(kinds[column])));
      for (std::size_t i = 0; i < methods.size(); ++i)
        panel.curve(svg, methods[i], rates[row], kinds[column], colours[i % std::size(colours)]);
    }
  }
  return svg.text();
}

}  // namespace berth::study
