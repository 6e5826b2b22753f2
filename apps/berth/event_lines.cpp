#include "event_lines.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>

#include "berth/base/words.hpp"
#include "log_level.hpp"

namespace berth::cli {
namespace {

std::string time_of_day() { return fmt::format("{:%H:%M:%S} ", fmt::localtime(std::time(nullptr))); }

}  // namespace

std::vector<std::string> EventLines::add(const operate::Event& event) {
  std::vector<std::string> lines;
  if (!joins(event)) {
    complete(lines);
    waiting_ = event;
  }
  slots_.push_back(event.slot);
  return lines;
}

std::vector<std::string> EventLines::rest() {
  std::vector<std::string> lines;
  complete(lines);
  return lines;
}

bool EventLines::joins(const operate::Event& event) const {
  return waiting_ && !event.slot.empty() && !waiting_->slot.empty() && event.at == waiting_->at &&
         event.bus == waiting_->bus && event.text == waiting_->text;
}

void EventLines::complete(std::vector<std::string>& into) {
  if (!waiting_) return;
  operate::Event event = *waiting_;
  event.slot = some_of(slots_, 4);
  std::string head;
  if (head_ == Head::time_of_day) head = time_of_day();
  if (head_ == Head::level) head = prefix_of(level_of(event));
  into.push_back(head + operate::to_line(event));
  waiting_.reset();
  slots_.clear();
}

}  // namespace berth::cli
