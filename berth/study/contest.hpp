/// `berth compare`: every way to find blank devices and give each a node-ID, on the same devices and the same bus.
///
/// A trial is one simulated world: blank devices have booted, then one master finds them by the method and gives each a
/// node-ID, until all that got one have sent their boot-up message. Nothing is stored in the devices, because that time
/// depends on them and not on the method. Giving is the same for every method, including Berth's: select, configure,
/// switch state global; the further steps of `places::Binder` are in `reproduce`. With `negotiation` there is no
/// master: all devices boot at once. At the end each device is compared with what it was given (study/verdict.hpp).
///
/// Published methods keep the windows of their papers, whatever the result; a cell shows if it found too few devices.
/// Planners and `identify` know the types of the devices, as from the slot table; no method knows a serial or revision
/// number. The slaves are the same for a published method and Berth's: RAND's for `rand` and `planner-rand`, CiA 305's
/// for `fastscan` and `planner-fastscan`, paper 4's for the feedback.
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
/// The protocols of its devices.
[[nodiscard]] plant::SpeaksSet speaks(const Contestant& contestant) noexcept;
/// True for Berth's own methods.
[[nodiscard]] bool is_planner(const Contestant& contestant) noexcept;

/// The parameters of a comparison.
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
  unsigned bound = 0;              ///< devices with their own node-ID at the end
  std::string trouble;             ///< why it ended early; empty if it did not
  std::vector<std::string> wrong;  ///< devices that differ from what they were given; such a trial's figures do not
                                   ///< count
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
  unsigned found = 0;                ///< minimum
  unsigned bound = 0;                ///< minimum
  std::string trouble{};             ///< of the last seed with one
  std::vector<std::string> wrong{};  ///< of all seeds
};
/// All cells in the order methods, devices, bit rates, serials, without results.
[[nodiscard]] std::vector<Cell> cells_of(const Contest& contest);
/// One trial of a cell; its seeds in `compare` are 1, 2, ...
[[nodiscard]] Trial trial(const Cell& cell, const plant::Latency& response, std::uint64_t seed);

/// The results of all cells, in the order of `cells_of`. Runs on `threads` threads; the result does not depend
/// on their number. `progress` gets the number of cells done, called by one thread at a time.
[[nodiscard]] std::vector<Cell> compare(const Contest& contest, unsigned threads,
                                        const std::function<void(std::size_t done, std::size_t all)>& progress = {});

/// A plot of the cells, bus time against devices, both logarithmic: one panel for each bit rate and kind of serial
/// numbers, one line per method; a hollow mark if not every device was bound. An SVG file.
[[nodiscard]] std::string plot(const std::vector<Cell>& cells);

}  // namespace berth::study
