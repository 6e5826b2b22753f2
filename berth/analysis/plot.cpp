#include "berth/analysis/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "berth/base/words.hpp"

namespace berth::analysis {
namespace {

constexpr double row_height = 14, left = 330, width = 560, right = 60, title_height = 50, foot = 30, top = 50;
// Of Okabe and Ito's, which most people can tell apart.
constexpr const char *kept = "#0072B2", *late = "#D55E00", *grid = "#DDDDDD", *black = "#000000";

double ms(rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

std::string words(double x, double y, const char* anchor, const std::string& text, int size = 10) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" font-size=\"{}\">{}</text>\n", x, y, anchor,
                     size, markup(text));
}

std::string stroke(double x1, double y1, double x2, double y2, const char* colour, double thick = 1) {
  return fmt::format(
      "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-width=\"{:g}\"/>\n", x1, y1,
      x2, y2, colour, thick);
}

/// Whole decades around all times of all buses, in ms.
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
  [[nodiscard]] std::string lines(double from, double to) const {
    std::string svg;
    for (double decade = low_; decade <= high_; ++decade) {
      const double x = left + width * (decade - low_) / (high_ - low_);
      svg += stroke(x, from, x, to, grid) + words(x, to + 14, "middle", fmt::format("{:g} ms", std::pow(10, decade)));
    }
    return svg;
  }

 private:
  double low_ = 0, high_ = 1;
};

std::string row(const PlottedBus& bus, const Response& r, const Scale& scale, double y) {
  const Message& m = bus.line->messages[r.message];
  const double begin = scale.at(r.frame);
  const double end = r.arrival ? scale.at(*r.arrival) : left + width;
  const bool good = r.arrival && r.meets_deadline;
  std::string svg = words(left - 8, y + row_height - 4, "end",
                          fmt::format("{} {}, {}", key_text(m.key), bus.line->senders[m.sender].name, m.name));
  svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>\n", begin, y + 3,
                     std::max(1.0, end - begin), row_height - 6, good ? kept : late);
  if (m.deadline.count() > 0) {
    const double x = scale.at(m.deadline);
    svg += stroke(x, y + 1, x, y + row_height - 1, black, 2);
  }
  return svg;
}

}  // namespace

std::string plot(std::span<const PlottedBus> buses) {
  double height = top;
  for (const auto& bus : buses) {
    height += title_height + foot + row_height * static_cast<double>(bus.result->responses.size());
  }
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
      "font-family=\"sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
      left + width + right, height);
  svg += words(left, 24, "start", "Worst-case response times, by priority", 16);
  svg +=
      words(left, 42, "start", "bar: from the frame's own time to the worst case; stroke: deadline; orange: late", 11);
  const Scale scale(buses);
  double y = top;
  for (const auto& bus : buses) {
    svg += words(left, y + title_height - 12, "start", bus.title, 13);
    y += title_height;
    const double end = y + row_height * static_cast<double>(bus.result->responses.size());
    svg += scale.lines(y, end);
    for (const auto& r : bus.result->responses) {
      svg += row(bus, r, scale, y);
      y += row_height;
    }
    y += foot;
  }
  return svg + "</svg>\n";
}

}  // namespace berth::analysis
