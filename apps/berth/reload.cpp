#include "reload.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <string_view>

#include "berth/base/words.hpp"
#include "berth/text/file.hpp"
#include "output.hpp"

namespace berth::cli {
namespace {

constexpr std::array<std::string_view, 4> taken_keys{"spares", "also", "replacement", "when_ambiguous"};

bool is_taken(const design::Difference& difference) {
  return difference.table.starts_with("slot ") && std::ranges::find(taken_keys, difference.key) != taken_keys.end();
}

std::optional<text::Value> parsed(const std::string& text, const std::string& file) {
  Findings ignored;  // the reading of the machine reports them
  return text::parse_toml(text, file, ignored);
}

}  // namespace

Changes changes_of(const text::Value& start, const text::Value& last, const text::Value& now) {
  Changes changes;
  for (auto& each : design::differences(last, now)) {
    if (is_taken(each)) changes.taken.push_back(std::move(each));
  }
  for (auto& each : design::differences(start, now)) {
    if (!is_taken(each)) changes.refused.push_back(std::move(each));
  }
  return changes;
}

std::optional<std::string> Reload::text_of(const std::string& machine_file) {
  Findings ignored;  // the reading of the machine reports them
  return text::read_file(machine_file, ignored);
}

Reload::Reload(MachineRun& run, std::vector<std::string> allow_outside, const std::string& start, Say say,
               std::function<void()> ended)
    : run_(run),
      allow_outside_(std::move(allow_outside)),
      start_(parsed(start, run.machine().file)),
      last_(start_),
      say_(std::move(say)),
      ended_(std::move(ended)) {
  run_.loop()->watch(bell_.descriptor(), *this, EPOLLIN);
}

Reload::~Reload() { run_.loop()->forget(bell_.descriptor()); }

void Reload::begin() {
  if (under_way_) {
    once_more_ = true;
    return;
  }
  under_way_ = true;
  const std::string file = run_.machine().file;
  reading_ = std::jthread([this, file] {
    read_.text = text_of(file);
    read_.result = design::load_machine(file, allow_outside_);
    bell_.ring();
  });
}

void Reload::ready(std::uint32_t) noexcept {
  bell_.silence();
  reading_.join();
  under_way_ = false;
  take(read_);
  ended_();
  if (std::exchange(once_more_, false)) begin();
}

void Reload::take(const Reading& reading) {
  const std::string& file = run_.machine().file;
  auto now = reading.text ? parsed(*reading.text, file) : std::nullopt;
  const bool good = reading.result.machine.has_value() && now && start_ && last_;
  if (!good) {
    const Failure wrong = failure(reading.result.findings);
    if (!reading.result.findings.empty()) say_(wrong.message);
    return say_(fmt::format("{}: nothing is taken over; the machine runs on as it was started", file));
  }
  const Changes changes = changes_of(*start_, *last_, *now);
  if (!changes.taken.empty()) run_.take_over(*reading.result.machine);
  say_all(changes);
  last_ = std::move(now);
}

void Reload::say_all(const Changes& changes) {
  const std::string& file = run_.machine().file;
  if (changes.taken.empty() && changes.refused.empty()) return say_(file + ": nothing has changed");
  std::vector<std::string> taken;
  std::ranges::transform(changes.taken, std::back_inserter(taken),
                         [](const auto& each) { return design::to_string(each); });
  if (!taken.empty()) say_(fmt::format("{}: taken over: {}", file, some_of(taken, 8)));
  for (const auto& each : changes.refused) {
    say_(fmt::format("{}:{}:{}: {}: takes effect when Berth is started again", file, each.place.line, each.place.column,
                     design::to_string(each)));
  }
}

}  // namespace berth::cli
