#include "berth/linker/device_pdos_parts.hpp"

#include <algorithm>

#include "berth/base/words.hpp"
#include "berth/od/cia301.hpp"
#include "berth/od/values.hpp"

namespace berth::linker {
namespace {

using co::PdoKind;

// Each length divides the longer ones, so that a gap is filled longest first.
constexpr unsigned last_dummy = 7;

class Reader {
 public:
  explicit Reader(const Node& node)
      : node_(node), description_(*node.file->description), values_(node.file->description, node.id) {
    if (node.linked_before) return;
    for (const auto& each : node.file->parameters) {
      if (od::is_pdo_record(each.object.index)) set_.push_back(each.object.index);
    }
  }

  DevicePdos run() {
    DevicePdos all;
    all.granularity = std::max<unsigned>(node_.file->device.granularity, 1);
    if (node_.file->device.granularity == 0) all.granularity = 8;
    for (const PdoKind kind : {PdoKind::tpdo, PdoKind::rpdo}) {
      auto& list = kind == PdoKind::tpdo ? all.tpdos : all.rpdos;
      od::for_each_communication(description_, kind, [&](unsigned number) { list.push_back(read(kind, number)); });
    }
    for (unsigned i = 0; i < od::cia301::most_mpdo_lists; ++i) {
      all.scanner += entries(static_cast<std::uint16_t>(od::cia301::first_scanner_list + i));
      all.dispatching += entries(static_cast<std::uint16_t>(od::cia301::first_dispatching_list + i));
    }
    read_dummies(all);
    read_other_ids(all);
    return all;
  }

 private:
  [[nodiscard]] const od::SubObject* sub(std::uint16_t index, std::uint8_t at) const noexcept {
    return description_.find(ObjectRef{index, at});
  }
  [[nodiscard]] bool writable(std::uint16_t index, std::uint8_t at) const noexcept {
    const auto* const found = sub(index, at);
    return found != nullptr && od::writable(found->access);
  }
  [[nodiscard]] unsigned entries(std::uint16_t index) const noexcept {
    unsigned count = 0;
    while (count < 254 && writable(index, static_cast<std::uint8_t>(count + 1))) ++count;
    return count;
  }

  DevicePdo read(PdoKind kind, unsigned number) const {
    const std::uint16_t index = od::communication_index(kind, number);
    const std::uint16_t mapping = od::mapping_index(kind, number);
    auto now = od::read_pdo(values_, kind, number);
    DevicePdo pdo;
    pdo.number = static_cast<std::uint16_t>(number);
    pdo.kept = std::ranges::find(set_, index) != set_.end() || std::ranges::find(set_, mapping) != set_.end();
    pdo.valid = now.cob_id.valid();
    pdo.can_id = now.cob_id.raw() & 0x3FFF'FFFF;
    pdo.type = now.type;
    pdo.inhibit = now.inhibit;
    pdo.event_ms = now.timer;
    pdo.fixed_id = !writable(index, od::pdo_sub::cob_id);
    pdo.fixed_type = !writable(index, od::pdo_sub::type);
    pdo.fixed_mapping = !writable(mapping, 0) || !writable(mapping, 1);
    pdo.most_entries = std::min(entries(mapping), od::most_pdo_entries);
    pdo.has_inhibit = writable(index, od::pdo_sub::inhibit);
    pdo.has_event = writable(index, od::pdo_sub::timer);
    pdo.mapping = std::move(now.entries);
    return pdo;
  }

  void read_dummies(DevicePdos& all) const {
    for (unsigned type = 1; type <= last_dummy; ++type) {
      const unsigned bits = od::bit_length(static_cast<od::DataType>(type));
      if (bits == 0 || !description_.dummy_mappable(static_cast<std::uint16_t>(type))) continue;
      if (bits % all.granularity == 0) all.dummies.push_back(type);
    }
    std::ranges::stable_sort(all.dummies, std::ranges::greater{},
                             [](unsigned type) { return od::bit_length(static_cast<od::DataType>(type)); });
  }

  void add_id(DevicePdos& all, ObjectRef object) const {
    const auto cob_id = values_.get_or<std::uint32_t>(object, cob_id_invalid);
    if ((cob_id & cob_id_invalid) == 0 || object.index == 0x1012) all.other_ids.push_back(cob_id & 0x1FFF'FFFF);
  }
  void read_other_ids(DevicePdos& all) const {
    for (const unsigned service : {0x1005U, 0x1012U, 0x1014U}) {
      const auto index = static_cast<std::uint16_t>(service);
      if (sub(index, 0) != nullptr) add_id(all, {index, 0});
    }
    for (const auto& object : description_.objects()) {
      if (!od::within(object.index, od::cia301::default_server, od::cia301::last_client)) continue;
      add_id(all, {object.index, 1});
      add_id(all, {object.index, 2});
    }
  }

  const Node& node_;
  const od::Description& description_;
  od::Values values_;
  std::vector<std::uint16_t> set_;
};

}  // namespace

const DevicePdo* DevicePdos::find(PdoKind kind, unsigned number) const noexcept {
  const auto found = std::ranges::find(of(kind), number, &DevicePdo::number);
  return found == of(kind).end() ? nullptr : &*found;
}

DevicePdos pdos_of(const Node& node) { return Reader(node).run(); }

bool is_dynamic(const eds::File& file, std::uint16_t index) noexcept {
  return std::ranges::any_of(file.dynamic_segments,
                             [index](const auto& each) { return index >= each.first && index <= each.last; });
}

bool written_by_linker(const eds::File& file) noexcept { return same_word(file.info.modified_by, linker_mark); }

}  // namespace berth::linker
