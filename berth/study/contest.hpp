/// `berth compare`: every way to find blank devices and give each a node-ID, on the same devices and the same bus.
///
/// A trial is one simulated world: blank devices have booted, then one master finds them by the method and gives each a
/// node-ID, until all that got one have sent their boot-up message. Nothing is stored in the devices: how long that
/// takes is theirs and not the method's. Giving is the same for every method, Berth's too: select, configure, switch
/// state global; what `places::Binder` does beyond that is in `reproduce`. With `negotiation` there is no master: all
/// devices boot at once. At the end each device is held against what it was given (study/verdict.hpp).
///
/// Published methods keep the windows of their papers, whatever comes of it: a cell that finds fewer devices than there
/// are says so. What a method may know: planners and `identify` the types of the devices, as the slot table has them;
/// none a serial or revision number. The slaves are the same for a published method and Berth's: RAND's for `rand`
/// and `planner-rand`, CiA 305's for `fastscan` and `planner-fastscan`, paper 4's for the feedback.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/discovery/discovery.hpp"
#include "berth/study/stage.hpp"

namespace berth::study {

/// A method of `discovery`, or the negotiation without a master (empty).
using Contestant = std::optional<discovery::Method>;
/// The ten, as `berth compare` lists them.
[[nodiscard]] std::vector<Contestant> contestants();
[[nodiscard]] std::string_view name(const Contestant& contestant) noexcept;
[[nodiscard]] std::optional<Contestant> contestant(std::string_view name) noexcept;
/// What its devices speak.
[[nodiscard]] plant::SpeaksSet speaks(const Contestant& contestant) noexcept;
/// True for Berth's own.
[[nodiscard]] bool is_planner(const Contestant& contestant) noexcept;

/// What is compared, and how.
struct Contest {
  std::vector<Contestant> methods = contestants();
  std::vector<unsigned> devices{1, 5, 30, 120};  ///< 1..126 each
  std::vector<std::uint32_t> bit_rates{50'000, 125'000, 1'000'000};
  std::vector<Serials> serials{Serials::consecutive, Serials::random, Serials::mixed};
  unsigned seeds = 3;  ///< trials of each cell, seeds 1, 2, ...
  plant::Latency response{.min = std::chrono::microseconds(200), .max = std::chrono::milliseconds(2)};
};

/// One trial.
struct Trial {
  rt::Duration bus_time{};   ///< from the first request to the last boot-up message, or to the master's end if that is
                             ///< later; negotiation: from the first frame until all are bound, to 5 ms
  std::uint64_t frames = 0;  ///< on the bus in this time, merged ones once
  std::uint64_t bits = 0;
  unsigned found = 0;              ///< distinct true addresses (negotiation: distinct node-IDs announced)
  unsigned bound = 0;              ///< devices with a node-ID of their own at the end
  std::string trouble;             ///< why it ended early; empty when it did not
  std::vector<std::string> wrong;  ///< devices that are not what they were made; a figure with any does not count
};
[[nodiscard]] Trial trial(const Contestant& method, const Cast& cast, std::uint32_t bit_rate);

/// One cell of the table, over all seeds.
struct Cell {
  Contestant method{};
  unsigned devices = 0;
  std::uint32_t bit_rate = 0;
  Serials serials = Serials::consecutive;
  rt::Duration bus_time{};  ///< mean
  rt::Duration worst{};
  std::uint64_t frames = 0;          ///< mean
  std::uint64_t bits = 0;            ///< mean
  unsigned found = 0;                ///< the least
  unsigned bound = 0;                ///< the least
  std::string trouble{};             ///< of the last seed that had any
  std::vector<std::string> wrong{};  ///< of all seeds
};
/// All cells in the order methods, devices, bit rates, serials. Runs on `threads` threads; what comes out does not
/// depend on their number. `progress` is called with the number of cells done, from one thread at a time.
[[nodiscard]] std::vector<Cell> compare(const Contest& contest, unsigned threads,
                                        const std::function<void(std::size_t done, std::size_t all)>& progress = {});

/// A plot of the cells, bus time against devices, both logarithmic: one panel for each bit rate and kind of serial
/// numbers, one line a method; a hollow mark where not every device was bound. An SVG file.
[[nodiscard]] std::string plot(const std::vector<Cell>& cells);

}  // namespace berth::study
