/// The matrix: the main job at every size, with every kind of device, at every bit rate. One cell is one machine and
/// one plant from a seed of its own, from all devices present to operational. Needs no test library: tests, ./run
/// matrix, bench/matrix.cpp and `berth study` use it.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::harness::matrix {

using namespace std::chrono_literals;

// What all devices of a cell speak, or have.
enum class Kind : std::uint8_t {
  rand,         // and LSS without Fastscan
  lss,          // without Fastscan, and nothing else
  fastscan,     // and nothing else
  feedback_29,  // and nothing else
  feedback_11,
  fixed,         // its slot's node-ID by switches, and its slot says so; every second one speaks LSS
  fixed_unsaid,  // the same, but its slot does not say so
  stored,        // a node-ID in its memory: its slot's, or that of another slot
  canopennode,   // Fastscan as CANopenNode does it
  lely,          // Fastscan as Lely core does it
  mixed,         // each device one of the above
  // Devices that lack parts of LSS; all sizes and bit rates only if the kind is chosen by name.
  no_identity,     // LSS without Fastscan and without 5Ah to 5Dh
  no_node_id,      // LSS without Fastscan and without 5Eh
  no_inquiries,    // LSS without Fastscan and without 5Ah to 5Eh
  bare,            // Fastscan, 40h to 43h, 11h, 17h, and nothing else
  fastscan_alone,  // Fastscan, 11h, 17h, and nothing else
  refuses_store,   // 17h is answered with error code 1
  short_answers,   // Fastscan, and answers without the zeros at their end
  stored_bare,     // LSS without Fastscan and inquiries, in its memory a node-ID that no slot has
  partial,         // each device one of these, or a complete one
  count
};
inline constexpr std::array<const char*, static_cast<std::size_t>(Kind::count)> kind_names{
    "rand",           "lss",           "fastscan",      "feedback-29",  "feedback-11",
    "fixed",          "fixed-unsaid",  "stored",        "canopennode",  "lely",
    "mixed",          "no-identity",   "no-node-id",    "no-inquiries", "bare",
    "fastscan-alone", "refuses-store", "short-answers", "stored-bare",  "partial"};
[[nodiscard]] inline const char* name(Kind kind) { return kind_names.at(static_cast<std::size_t>(kind)); }

enum class Latency : std::uint8_t {
  equal,     // 1 ms
  random,    // 0.2 to 4 ms
  outliers,  // 0.2 to 2 ms, and 30 ms once in a hundred
  count,
  wide = count  // 0.1 to 9 ms, just within `rand_response`; not part of the matrix
};
inline constexpr std::array<const char*, static_cast<std::size_t>(Latency::count) + 1> latency_names{
    "equal", "random", "outliers", "wide"};
[[nodiscard]] inline const char* name(Latency latency) { return latency_names.at(static_cast<std::size_t>(latency)); }

inline constexpr std::array<unsigned, 7> sizes{1, 2, 5, 30, 60, 120, 126};
inline constexpr std::array<std::uint32_t, 5> bit_rates{10'000, 50'000, 125'000, 500'000, 1'000'000};

struct Cell {
  Kind kind = Kind::rand;
  unsigned devices = 1;
  std::uint32_t bit_rate = 125'000;
  Latency latency = Latency::equal;
  unsigned rx_depth = 16;            // frames that a device's receive buffer holds; not part of the matrix
  std::string_view method = "auto";  // `[bus] discovery`; not part of the matrix
  std::uint64_t round = 0;           // another one: the same cell with other serial numbers and answers
};

// The published methods that find all devices of this kind; none if only Berth's default does.
[[nodiscard]] inline std::span<const std::string_view> published(Kind kind) {
  static constexpr std::array<std::string_view, 4> words{"rand", "fastscan", "fastscan-feedback-29",
                                                         "fastscan-feedback-11"};
  const std::span all(words);
  switch (kind) {
    case Kind::rand: return all.subspan(0, 1);
    case Kind::fastscan:
    case Kind::canopennode:
    case Kind::lely: return all.subspan(1, 1);
    case Kind::feedback_29: return all.subspan(2, 1);
    case Kind::feedback_11: return all.subspan(3, 1);
    default: return {};
  }
}

[[nodiscard]] inline std::string describe(const Cell& c) {
  return std::string(name(c.kind)) + ", " + std::to_string(c.devices) + " devices, " +
         std::to_string(c.bit_rate / 1000) + " kbit/s, " + name(c.latency);
}

// A cell of the default run. Devices that lack parts of LSS are tried only in small numbers there.
[[nodiscard]] inline bool is_usual(const Cell& c) {
  return c.kind <= Kind::mixed || (c.devices <= 5 && c.bit_rate == 125'000);
}

// Why docs/limits.md excepts this cell; empty for the others.
[[nodiscard]] inline std::optional<std::string_view> limit_of(const Cell&) { return std::nullopt; }

// Bus time within which a cell must be operational: twice what its frames take if each device needs as many questions
// as one whose serial number tells nothing about the others', and twice that if answers come late (docs/limits.md).
[[nodiscard]] inline rt::Duration budget(const Cell& c) {
  const auto frame = rt::Duration(128LL * 1'000'000'000 / c.bit_rate);
  // Plain LSS asks in six frames, the others in one; 32 questions at most. Node-ID, check and start take forty more.
  const bool by_ranges = c.kind == Kind::lss || c.kind == Kind::stored || c.kind >= Kind::mixed;
  const std::int64_t frames = by_ranges ? 32 * 7 : 32 * 3;
  const rt::Duration one = (frames + 40) * frame + 300ms;
  // CANopenNode's slaves delay one answer in fifty tenfold; Lely core's need a workaround.
  const bool known = c.kind == Kind::canopennode || c.kind == Kind::lely || c.kind == Kind::mixed;
  return (c.latency == Latency::outliers ? 2 : 1) * (known ? 4 : 2) * (15s + c.devices * one);
}

enum class End : std::uint8_t {
  operational,
  gave_up,  // nothing more happens, as `berth up` judges it
  late,     // not within its bus time
  lost,     // operational, but no longer ten seconds later
  wrong,    // reported operational, but the devices are not
  busy,     // operational, and Berth sends more than `most_at_rest`
};
[[nodiscard]] inline const char* name(End end) {
  constexpr std::array<const char*, 6> names{"operational", "gave up", "too late", "lost", "wrong", "busy at rest"};
  return names.at(static_cast<std::size_t>(end));
}

// Plain bytes: it goes through a pipe.
struct Outcome {
  End end = End::late;
  rt::Duration bus_time{0};  // from Berth's first instant to operational, or to the end
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;    // receptions that devices lost: overrun, or deaf
  std::uint64_t hash = 0;    // of everything that happened on the bus
  double at_rest = 0;        // Berth's frames per second, with its heartbeat
  unsigned operational = 0;  // slots
  std::array<char, 400> why{};

  void say(std::string_view words) {
    const auto size = std::min(words.size(), why.size() - 1);
    std::ranges::copy(words.substr(0, size), why.begin());
    why.at(size) = '\0';
  }
};

// Frames per second that Berth may send on a bus on which nothing happens.
inline constexpr double most_at_rest = 5;

/// Takes each line of what is shown of a run.
using Show = std::function<void(const std::string& line)>;
/// From blank devices to operational, at most `limit` of bus time, and what Berth sends afterwards. `show`, unless it
/// is empty, gets every event, and with `frames` every frame too, LSS in words.
[[nodiscard]] Outcome run(const Cell& cell, rt::Duration limit, const Show& show = {}, bool frames = false);

/// Which cells; none: all.
struct Selection {
  std::optional<Kind> kind;
  std::optional<unsigned> devices;
  std::optional<std::uint32_t> bit_rate;
  std::optional<Latency> latency;
  unsigned rx_depth = 16;
};
/// In the order kinds, sizes, bit rates, latencies. What a device may lack of LSS (`is_usual`) is tried at all sizes
/// where its kind is chosen by name.
[[nodiscard]] std::vector<Cell> cells_of(const Selection& selection);

}  // namespace berth::harness::matrix
