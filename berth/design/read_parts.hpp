/// Shared by the parts of the machine file's reader (read_machine.cpp, read_slot.cpp, read_bus.cpp, read_channel.cpp,
/// read_link.cpp). Internal to room `design`.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "berth/design/machine.hpp"
#include "berth/text/reach.hpp"
#include "berth/text/toml.hpp"

namespace berth::design {

inline constexpr text::Limits node_ids{1, 127};

template <class Enum, std::size_t N>
void read_word(text::Table& table, std::string_view key, const std::array<std::string_view, N>& words, Enum& into) {
  if (const auto index = table.word(key, words)) into = static_cast<Enum>(*index);
}

/// `places::SlotAsks::unasked` of `type = "any"`.
inline constexpr std::uint8_t any_type = 3;
/// `probe`; `says_how`: the slot has `when_ambiguous`.
void read_probe(text::Table& table, places::SlotSpec& spec, bool says_how);
/// `id` or `ids`; empty after an error.
[[nodiscard]] std::vector<unsigned> read_ids(text::Table& table, Slot& slot);
/// `name`, for a range with {id} in it; empty after an error.
[[nodiscard]] std::string read_name(text::Table& table, bool of_range);
/// `type = { vendor, product, revision }`, and `type = "any"`.
void read_type_table(text::Table& table, places::SlotSpec& spec);
void read_any(text::Table& table, places::SlotSpec& spec);
/// 1000h in the description of a slot for any type; 0: not given.
[[nodiscard]] std::uint32_t described_type(const Slot& slot);
/// `assign`. A slot for any type has a fixed node-ID, because nothing else is known of its device.
void read_assign(text::Table& table, places::SlotSpec& spec);

/// The keys of `[timing]` beneath `parent` override the values in `timing`.
void read_timing(text::Table& parent, Timing& timing);
/// `heartbeat_timeout` must be longer than `heartbeat_period`: else an error there.
void check_heartbeat(text::Table& table, Duration period, Duration timeout);
/// The keys of a `[[slot]]` that set how its device is watched.
void read_watch(text::Table& slot, places::SlotWatch& watch);
/// The keys of a `[[slot]]` on how its device sends: `queue`, `inhibit`.
void read_sending(text::Table& table, Slot& slot);
/// Beneath a gateway its own master watches all devices by the bus's [timing] (1F81h, 1016h).
void refuse_watch(text::Table& slot, const places::SlotWatch& watch);
/// One `[bus.NAME]`; its timing begins with `timing`.
[[nodiscard]] Bus read_bus(const std::string& name, text::Table& table, const Timing& timing);
/// "left/1001h", "3/5/Position": the slot, and the object as written. Empty, with an error at `key`: the machine, whose
/// slots are already there, has no such slot.
[[nodiscard]] std::optional<LinkEnd> read_end(const Machine& machine, text::Table& table, std::string_view key,
                                              const std::string& text);
/// `publish` of a `[[slot]]`.
void read_publish(text::Table& table, Slot& slot);
/// [mqtt]; the slots are there already, and their names must be possible at a broker. `reach`: of the machine file.
void read_mqtt(Machine& machine, text::Table& root, const text::Reach& reach);
/// `watch` of [machine]; the slots are there already.
void read_watched(Machine& machine, text::Table& root);
/// One `[[link]]`; its ends are slots of `machine`, which has them already.
[[nodiscard]] Link read_link(const Machine& machine, text::Table& table);
/// One `[[channel]]`; the buses and slots are there already.
void read_channel(Machine& machine, text::Table& table);
/// Buses that Berth reaches only through gateways become `beneath`, each above those beneath it.
void part_buses(Machine& machine);

}  // namespace berth::design
