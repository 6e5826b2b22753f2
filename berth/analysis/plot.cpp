#include "berth/analysis/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "berth/base/svg.hpp"

namespace berth::analysis {
namespace {

constexpr double row_height = 14, left = 330, width = 560, right = 60, title_height = 50, foot = 30, top = 50;
constexpr int row_size = 10;  // font size of the words

double ms(rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

/// A logarithmic axis of whole decades, in ms, that covers all times of all buses.
class Scale {
 public:
  explicit Scale(std::span<const PlottedBus> buses) {
    double least = 1e9, most = 1e-9;
    const auto add = [&](rt::Duration time) {
      if (time.count() <= 0) return;
      least = std::min(least, ms(time));
      most = std::max(most, ms(time));
    };
    for (const auto& bus : buses) {
      for (const auto& r : bus.result->responses) {
        add(r.frame);
        add(r.arrival.value_or(rt::Duration{0}));
        add(bus.line->messages[r.message].deadline);
      }
    }
    if (least > most) least = most = 1;
    low_ = std::floor(std::log10(least));
    high_ = std::max(low_ + 1, std::ceil(std::log10(most)));
  }
  [[nodiscard]] double at(rt::Duration time) const {
    return left + width * (std::log10(std::max(1e-9, ms(time))) - low_) / (high_ - low_);
  }
  void draw(Svg& svg, double from, double to) const {
    for (double decade = low_; decade <= high_; ++decade) {
      const double x = left + width * (decade - low_) / (high_ - low_);
      svg.line(x, from, x, to, colour::grid);
      svg.words(x, to + 14, "middle", fmt::format("{:g} ms", std::pow(10, decade)), row_size);
    }
  }

 private:
  double low_ = 0, high_ = 1;
};

void draw_row(Svg& svg, const PlottedBus& bus, const Response& r, const Scale& scale, double y) {
  const Message& m = bus.line->messages[r.message];
  const double begin = scale.at(r.frame);
  const double end = r.arrival ? scale.at(*r.arrival) : left + width;
  const bool good = r.arrival && r.meets_deadline;
  svg.words(left - 8, y + row_height - 4, "end",
            fmt::format("{} {}, {}", key_text(m.key), bus.line->senders[m.sender].name, m.name), row_size);
  svg.rectangle(begin, y + 3, std::max(1.0, end - begin), row_height - 6, good ? colour::blue : colour::vermilion);
  if (m.deadline.count() > 0) {
    const double x = scale.at(m.deadline);
    svg.line(x, y + 1, x, y + row_height - 1, colour::black, 2);
  }
}

}  // namespace

std::string plot(std::span<const PlottedBus> buses) {
  double height = top;
  for (const auto& bus : buses) {
    height += title_height + foot + row_height * static_cast<double>(bus.result->responses.size());
  }
  Svg svg(left + width + right, height);
  svg.words(left, 24, "start", "Worst-case response times, by priority", 16);
  svg.words(left, 42, "start", "bar: from the frame's own time to the worst case; stroke: deadline; orange: late", 11);
  const Scale scale(buses);
  double y = top;
  for (const auto& bus : buses) {
    svg.words(left, y + title_height - 12, "start", bus.title, 13);
    y += title_height;
    const double end = y + row_height * static_cast<double>(bus.result->responses.size());
    scale.draw(svg, y, end);
    for (const auto& r : bus.result->responses) {
      draw_row(svg, bus, r, scale, y);
      y += row_height;
    }
    y += foot;
  }
  return svg.text();
}

}  // namespace berth::analysis
