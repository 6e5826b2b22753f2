#include "berth/traffic/bus_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "berth/base/counted.hpp"
#include "berth/co/cob_id.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/linker/bounds.hpp"
#include "berth/od/names.hpp"
#include "berth/od/pdo_objects.hpp"
#include "berth/od/values.hpp"
#include "berth/text/quantity.hpp"
#include "berth/traffic/configured_values.hpp"

namespace berth::traffic {
namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t produces_sync = co::CobId::second_bit;

class Collector {
 public:
  Collector(const design::Machine& machine, const design::Bus& bus, const Assumptions& assumptions)
      : machine_(machine), bus_(bus), assumed_(assumptions) {
    line().bit_rate = bus.bitrate;
    line().background_bytes = 8;
    line().background_extended = true;  // RAND's identifiers
  }

  BusMessages run() {
    for (const auto& slot : machine_.slots) {
      if (slot.spec.name.bus == bus_.name) devices_.push_back(opened(slot));
    }
    open_gateway_node();
    master_ = add_sender("master", own_queue());
    if (bus_.sync) add_sync("master", master_, 0x80, bus_.sync->counter != 0, bus_.sync->period);
    for (const Device& device : devices_) add_sync_of(device);
    for (const Device& device : devices_) add_device(device);
    if (own_) add_tpdos(*own_);
    add_master();
    tell_unknown();
    tell_queues();
    if (assumed_.pdos) tell_links();
    std::ranges::stable_sort(line().messages,
                             [](const auto& a, const auto& b) { return analysis::precedes(a.key, b.key); });
    return std::move(found_);
  }

 private:
  struct Device {
    const design::Slot* slot;
    std::size_t sender;
    std::unique_ptr<od::Values> values;  // null: its dictionary is unknown
  };

  analysis::Line& line() noexcept { return found_.line; }

  void note(std::string key, std::string message, std::string fix = {}) {
    found_.notes.push_back(
        {Finding::Severity::note, machine_.file, 0, 0, std::move(key), std::move(message), std::move(fix)});
  }

  static analysis::Queue queue_of(const design::Slot& slot) noexcept {
    if (slot.queue == design::SendOrder::unknown) return analysis::Queue::unknown;
    return slot.queue == design::SendOrder::in_order ? analysis::Queue::in_order : analysis::Queue::priority;
  }

  /// Berth gives its frames to the port in their order. A simulated port sends them in that order; a controller with
  /// several transmit buffers may send the buffered ones by identifier.
  [[nodiscard]] analysis::Queue own_queue() const noexcept {
    const bool simulated = bus_.port.kind == can::PortKind::sim || bus_.port.kind == can::PortKind::plant;
    return simulated && bus_.own_port ? analysis::Queue::in_order : analysis::Queue::unknown;
  }

  std::size_t add_sender(const std::string& name, analysis::Queue queue) {
    const bool fifo = std::ranges::any_of(assumed_.fifo, [&](const auto& f) { return f == name || f == "all"; });
    line().senders.push_back({name, fifo ? analysis::Queue::in_order : queue});
    return line().senders.size() - 1;
  }

  // The device with its dictionary as configured.
  Device opened(const design::Slot& slot) {
    const std::size_t sender = add_sender(slot.spec.name.name, queue_of(slot));
    const std::size_t node = assumed_.links == nullptr ? 0 : node_of(slot);
    return {&slot, sender, configured_values(slot, assumed_.links, node)};
  }

  // A gateway's own node on this bus is no slot, but its TPDOs carry the signals that cross the gateway.
  void open_gateway_node() {
    if (bus_.own_port || !bus_.gateway || bus_.gateway->eds_path.empty() || !assumed_.pdos) return;
    const auto reading = eds::read_any_file(bus_.gateway->eds_path);
    if (!reading.usable()) return;
    own_slot_.spec.name.name = design::gateway_node_name(bus_);
    own_slot_.spec.id = bus_.master;
    own_slot_.description = reading.file.description;
    own_.emplace(opened(own_slot_));
  }

  [[nodiscard]] std::size_t node_of(const design::Slot& slot) const {
    if (&slot == &own_slot_) {
      const auto& nodes = assumed_.links->network.nodes;
      const auto it = std::ranges::find(nodes, slot.spec.name.name, &linker::Node::name);
      return static_cast<std::size_t>(it - nodes.begin());
    }
    return static_cast<std::size_t>(&slot - machine_.slots.data());
  }

  /// The effect of the links on the TPDO that carries them.
  struct Linked {
    bool any = false;
    linker::Sending sending = {};
    std::optional<rt::Duration> deadline = {};
    rt::Duration said{};  // least interval; 0: not given
  };

  void keep_planned(const design::Slot& slot, unsigned number, Linked& linked) {
    if (assumed_.links == nullptr) return;
    for (const auto& pdo : assumed_.links->plan.pdos) {
      if (pdo.producer != node_of(slot) || pdo.tpdo != number) continue;
      for (const std::size_t link : pdo.links) {
        carried_.push_back(&machine_.links[link]);
        linked.said = std::max<rt::Duration>(linked.said, machine_.links[link].inhibit.value_or(design::Duration(0)));
      }
      linked.any = true;
      linked.sending = linker::sending_of(assumed_.links->network, pdo);
      linked.deadline = pdo.deadline;
    }
  }

  void add(const std::string& name, std::size_t sender, std::uint32_t key, unsigned bytes, rt::Duration period,
           rt::Duration deadline) {
    line().messages.push_back(
        {.name = name, .sender = sender, .key = key, .data_bytes = bytes, .period = period, .deadline = deadline});
  }

  void add_sync_of(const Device& device) {
    if (!device.values) return;
    const auto cob_id = device.values->get_or<std::uint32_t>({0x1005, 0}, 0);
    const auto period = std::chrono::microseconds(device.values->get_or<std::uint32_t>({0x1006, 0}, 0));
    if ((cob_id & produces_sync) == 0 || period == 0us) return;
    const bool counts = device.values->get_or<std::uint8_t>({0x1019, 0}, 0) != 0;
    add_sync(device.slot->spec.name.name, device.sender, co::CobId(cob_id).key(), counts, period);
  }

  void add_sync(const std::string& producer, std::size_t sender, std::uint32_t key, bool counts, rt::Duration period) {
    if (!sync_producer_.empty()) {
      note(fmt::format("bus.{}.sync", bus_.name), fmt::format("{} and {} both produce SYNC", sync_producer_, producer),
           "leave one: [bus.NAME.sync], or bit 30 of the device's 1005h");
    }
    sync_producer_ = producer;
    add("SYNC", sender, key, counts ? 1 : 0, period, 0ns);
    sync_ = sync_ == 0ns ? period : std::min(sync_, period);
    sync_key_ = key;
  }

  void add_device(const Device& device) {
    const NodeId id = device.slot->spec.id;
    add("heartbeat", device.sender, 0x700U + id.value(), 1, bus_.timing.heartbeat_period, bus_.timing.heartbeat_period);
    rt::Duration inhibit{};
    std::uint32_t emcy = 0x80U + id.value();
    if (device.values) {
      inhibit = 100us * device.values->get_or<std::uint16_t>({0x1015, 0}, 0);
      emcy = device.values->get_or<std::uint32_t>({0x1014, 0}, emcy);
      if (assumed_.pdos) add_tpdos(device);
    }
    if (co::CobId(emcy).valid())
      add("EMCY", device.sender, co::CobId(emcy).key(), 8, inhibit > 0ns ? inhibit : assumed_.emcy, 0ns);
  }

  void add_tpdos(const Device& device) {
    od::for_each_communication(device.values->description(), od::PdoKind::tpdo,
                               [&](unsigned number) { add_tpdo(device, number); });
  }

  void add_tpdo(const Device& device, unsigned number) {
    const auto pdo = od::read_pdo(*device.values, od::PdoKind::tpdo, number);
    if (!pdo.cob_id.valid()) return;
    const std::string name = fmt::format("TPDO {}", number);
    const std::string where = fmt::format("{}/{}", device.slot->spec.name.name, name);
    if (!is_sent(pdo, where)) return;
    Linked linked{
        .sending = {.transmission = pdo.type, .inhibit = 100us * pdo.inhibit, .sync = sync_, .sync_key = sync_key_}};
    for (const auto& entry : pdo.entries) keep_link(*device.slot, entry.object, linked);
    keep_planned(*device.slot, number, linked);
    if (linked.said == 0ns) linked.said = device.slot->inhibit.value_or(design::Duration(0));
    const auto period = period_of(pdo, where, linked.said);
    const bool whole_frame = pdo.count > od::most_pdo_entries;  // an MPDO
    const unsigned bits = whole_frame ? od::most_pdo_bits : std::min(pdo.bits(), od::most_pdo_bits);
    add(name, device.sender, pdo.cob_id.key(), (bits + 7) / 8, period, 0ns);
    linker::set_sending(line().messages.back(), linked.sending, linked.any, linked.deadline);
  }

  // Does the device send it by itself?
  bool is_sent(const od::PdoParameters& pdo, const std::string& where) {
    const auto why = linker::unsent(pdo.type, sync_);
    if (why == linker::Unsent::on_remote_frames)
      note(where, "it is sent when a remote frame asks for it: not analysed");
    if (why == linker::Unsent::waits_for_sync) note(where, "it waits for SYNC, and nothing on this bus produces that");
    return why == linker::Unsent::no;
  }

  /// `said`: the least interval given by the links that the PDO carries, or by its slot; 0: none.
  rt::Duration period_of(const od::PdoParameters& pdo, const std::string& where, rt::Duration said) {
    const rt::Duration inhibit = 100us * pdo.inhibit;
    const auto period = linker::least_interval(pdo.type, inhibit, sync_, said);
    if (linker::synchronous(pdo.type) || inhibit > 0ns) return period;
    (period > 0ns ? promised_ : endless_).push_back(where);
    return period > 0ns ? period : assumed_.event;
  }

  void keep_link(const design::Slot& slot, ObjectRef object, Linked& linked) {
    meant_.resize(machine_.links.size());
    for (std::size_t i = 0; i < machine_.links.size(); ++i) {
      const auto& link = machine_.links[i];
      if (link.from.slot != slot.spec.name.name || !slot.description) continue;
      // Looks up each name once: a device may have a hundred links, and thousands of objects.
      if (!meant_[i]) {
        const auto found = od::find_object(*slot.description, link.from.object);
        meant_[i] = found ? std::optional(*found) : std::nullopt;
      }
      if (*meant_[i] != object) continue;
      carried_.push_back(&link);
      linked.any = true;
      if (!link.deadline) continue;
      linked.deadline = std::min<rt::Duration>(linked.deadline.value_or(*link.deadline), *link.deadline);
    }
  }

  void add_master() {
    const std::size_t sender = master_;
    if (bus_.role == design::Role::master) {
      add("NMT", sender, 0, 2, assumed_.nmt, 0ns);
      add("heartbeat", sender, 0x700U + bus_.master.value(), 1, bus_.timing.heartbeat_period,
          bus_.timing.heartbeat_period);
    }
    if (devices_.empty() || bus_.role == design::Role::observer) return;
    // There is one request at a time: the analysis sends all to the device with the highest-priority identifiers.
    const Device& first =
        *std::ranges::min_element(devices_, {}, [](const auto& d) { return d.slot->spec.id.value(); });
    const unsigned id = first.slot->spec.id.value();
    // Each response comes before the next request; its delay after its own request depends on the device.
    add("SDO response", first.sender, 0x580U + id, 8, assumed_.sdo, 0ns);
    line().messages.back().jitter = assumed_.sdo;
    add("SDO request", sender, 0x600U + id, 8, assumed_.sdo, 0ns);
  }

  void tell_unknown() {
    const auto unknown = std::ranges::count_if(devices_, [](const auto& d) { return !d.values; });
    if (unknown > 0)
      note("",
           fmt::format("{} of {} slots have no description: which PDOs their devices send is not known", unknown,
                       devices_.size()),
           "add eds = \"FILE\" to the slot");
    if (!promised_.empty()) {
      note("",
           fmt::format("{} without an inhibit time {} as far apart as the machine file says: {}",
                       counted(promised_.size(), "TPDO"), promised_.size() == 1 ? "is" : "are", first_of(promised_)));
    }
    if (endless_.empty()) return;
    const std::string what = counted(endless_.size(), "TPDO");
    if (assumed_.event > 0ns) {
      note("", fmt::format("{} at a change without an inhibit time: one every {} is assumed (--event): {}", what,
                           text::write_duration(assumed_.event), first_of(endless_)));
    } else {
      note("",
           fmt::format("{} at a change without an inhibit time: the shortest interval is not known, so neither {} nor "
                       "frames of lower priority than {} have a bound: {}",
                       what, endless_.size() == 1 ? "it" : "they", endless_.size() == 1 ? "it" : "them",
                       first_of(endless_)),
           "set an inhibit time (sub-index 3), write inhibit = \"10 ms\" into the slot, or say --event TIME");
    }
  }

  void tell_queues() {
    std::vector<std::string> unknown;
    for (const auto& sender : line().senders) {
      if (sender.queue == analysis::Queue::unknown && sender.name != "master") unknown.push_back(sender.name);
    }
    if (line().senders[master_].queue == analysis::Queue::unknown && bus_.own_port &&
        bus_.role != design::Role::observer) {
      note("",
           "Berth's own frames wait in order, but a controller with several transmit buffers may send those that it "
           "holds by identifier: the worse order is assumed for each");
    }
    if (unknown.empty()) return;
    note("",
         fmt::format("it is not known in which order {} {} (by identifier, or as they came): the worse order is "
                     "assumed for each: {}",
                     unknown.size() == 1 ? "a device" : fmt::format("{} devices", unknown.size()),
                     unknown.size() == 1 ? "sends its frames" : "send their frames", first_of(unknown)),
         "write queue = \"priority\" or \"in-order\" into the slot");
  }

  static std::string first_of(const std::vector<std::string>& names) {
    constexpr std::size_t most = 3;
    std::string made;
    for (std::size_t i = 0; i < std::min(most, names.size()); ++i) made += (i == 0 ? "" : ", ") + names[i];
    return names.size() > most ? made + fmt::format(" and {} more", names.size() - most) : made;
  }

  void tell_links() {
    for (const auto& link : machine_.links) {
      const auto* const slot = machine_.slot(link.from.slot);
      const bool here = slot != nullptr && slot->spec.name.bus == bus_.name;
      if (!here || std::ranges::find(carried_, &link) != carried_.end()) continue;
      found_.notes.push_back({Finding::Severity::warning, machine_.file, link.place.line, link.place.column,
                              fmt::format("{}/{}", link.from.slot, link.from.object),
                              "no TPDO of this slot carries this object: the link has no bound",
                              "map it in the slot's config"});
    }
  }

  const design::Machine& machine_;
  const design::Bus& bus_;
  const Assumptions& assumed_;
  BusMessages found_;
  std::vector<Device> devices_;
  design::Slot own_slot_;  // of `own_`
  std::optional<Device> own_;
  std::vector<const design::Link*> carried_;
  std::vector<std::optional<std::optional<ObjectRef>>> meant_;  // by link: its source; inner one empty: no such object
  rt::Duration sync_{0};
  std::uint32_t sync_key_ = linker::default_sync_key;
  std::string sync_producer_;
  std::size_t master_ = 0;
  std::vector<std::string> promised_;  // TPDOs whose least interval the machine file gives
  std::vector<std::string> endless_;   // TPDOs without any least interval
};

}  // namespace

BusMessages messages_of(const design::Machine& machine, const design::Bus& bus, const Assumptions& assumptions) {
  return Collector(machine, bus, assumptions).run();
}

}  // namespace berth::traffic
