#include "berth/fleet/machine_list.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "berth/fleet/machines_json.hpp"

namespace berth::fleet {

MachineList::Part MachineList::since(std::uint64_t number, std::size_t most) const {
  if (number == changes_) return {.changes = changes_};
  Part part{.changes = changes_};
  // A number of another list, or of another process.
  part.whole = number <= base_ || number > changes_;
  if (part.whole) number = base_;
  part.machines = "[";
  auto line = std::ranges::upper_bound(lines_, number, {}, &Line::number);
  for (; line != lines_.end(); ++line) {
    const bool first = part.machines.size() == 1;
    if (!first && part.machines.size() + line->json->size() > most) {
      part.changes = std::prev(line)->number;
      part.more = true;
      break;
    }
    if (!first) part.machines += ',';
    part.machines += *line->json;
  }
  part.machines += ']';
  return part;
}

std::shared_ptr<const MachineList> MachineLister::take(std::vector<MachineView> now) {
  const auto still = std::ranges::count_if(now, [&](const auto& view) { return known_.contains(view.id); });
  bool any = static_cast<std::size_t>(still) < known_.size();
  if (any) {
    known_.clear();
    base_ = ++changes_;
  }
  for (auto& view : now) {
    auto& known = known_[view.id];
    if (known.line.json && known.view == view) continue;
    any = true;
    known.line.number = ++changes_;
    known.line.json = std::make_shared<const std::string>(
        machine_json(view).dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
    known.view = std::move(view);
  }
  return any ? list() : nullptr;
}

std::shared_ptr<const MachineList> MachineLister::forget() {
  known_.clear();
  base_ = ++changes_;
  return list();
}

std::shared_ptr<const MachineList> MachineLister::list() const {
  auto made = std::make_shared<MachineList>();
  made->base_ = base_;
  made->changes_ = changes_;
  for (const auto& [id, known] : known_) made->lines_.push_back(known.line);
  std::ranges::sort(made->lines_, {}, &MachineList::Line::number);
  return made;
}

}  // namespace berth::fleet
