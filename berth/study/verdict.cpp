#include "berth/study/verdict.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::study {
namespace {

std::string text(NodeId id) { return id.configured() ? fmt::format("node-ID {}", id.value()) : "no node-ID"; }

bool holds(const plant::Truth& truth, NodeId id, Hold hold) noexcept {
  if (truth.pending != id) return false;
  if (hold == Hold::pending) return true;
  return truth.active == id && (hold != Hold::stored || truth.persistent == id);
}

std::string difference(const plant::Truth& truth, NodeId wanted) {
  return fmt::format("{}: {} in use, {} pending, {} stored; {} was given", truth.name, text(truth.active),
                     text(truth.pending), text(truth.persistent), text(wanted));
}

}  // namespace

std::vector<std::string> differences(Stage& stage, const std::vector<places::Assignment>& given, Hold hold) {
  std::vector<std::string> lines;
  for (const auto& truth : stage.world().truth()) {
    const auto seat = std::ranges::find(given, truth.address, &places::Assignment::device);
    const NodeId id = seat == given.end() ? NodeId() : seat->id;
    if (!holds(truth, id, seat == given.end() ? Hold::active : hold)) lines.push_back(difference(truth, id));
  }
  for (auto seat = given.begin(); seat != given.end(); ++seat) {
    const auto same = std::find_if(std::next(seat), given.end(),
                                   [&](const auto& s) { return s.id == seat->id || s.device == seat->device; });
    if (same != given.end()) lines.push_back(fmt::format("{} was given twice", text(seat->id)));
  }
  return lines;
}

std::vector<std::string> differences(Stage& stage, const std::vector<LssAddress>& found) {
  std::vector<std::string> lines;
  std::vector<LssAddress> real;
  for (const auto& truth : stage.world().truth()) {
    real.push_back(truth.address);
    if (std::ranges::count(found, truth.address) != 1)
      lines.push_back(fmt::format("{} was found {} times", truth.name, std::ranges::count(found, truth.address)));
  }
  for (const auto& address : found) {
    if (std::ranges::find(real, address) == real.end())
      lines.push_back(fmt::format("{} was found and is not a device", to_string(address)));
  }
  return lines;
}

std::vector<places::Assignment> seats_from(Stage& stage, unsigned first) {
  std::vector<places::Assignment> seats;
  for (const auto& device : stage.world().devices())
    seats.push_back({device->plan().address, NodeId(static_cast<std::uint8_t>(first++))});
  return seats;
}

bool right(Figures& figures, const std::string& name, const std::vector<std::string>& differences) {
  for (const auto& line : differences) figures.wrong.push_back(name + ": " + line);
  return differences.empty();
}

}  // namespace berth::study
