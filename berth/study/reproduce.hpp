/// `berth reproduce`: every figure that papers 1, 2 and 4 print for finding devices and giving them node-IDs, and paper
/// 3's numbers of nodes and accesses: published, by formula, simulated on the bit-exact bus, and the same job as
/// Berth's own code does it: found by its planners, bound by `places::Binder`.
///
/// Formula and simulation never look at each other: the formula is arithmetic with frame lengths, time-outs and the
/// conditions; the simulation is the procedure itself on devices that answer. A simulated time is the span of a
/// recorded trace, from the end of its first frame to the end of its last, as `berth trace --stats` prints it. Where a
/// procedure ends (or begins) with silence, the mark is a heartbeat of the master, 77F#05; the row's `marks` says which
/// frames the marks are.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/rt/executor.hpp"
#include "berth/trace/trace.hpp"

namespace berth::study {

/// What a person sets; empty: as the paper has it.
struct Conditions {
  std::optional<std::uint32_t> bit_rate{};  ///< bit/s; paper 1: 50,000; papers 2 and 4 name none: 125,000
  std::optional<rt::Duration> latency{};    ///< of a device's answers; paper 1: 4 ms; else 0.5 ms
};

/// One figure. Times in seconds; shares are numbers without a unit (`unit` is then "share"), "nodes" and "accesses"
/// whole numbers.
struct Row {
  unsigned paper = 0;
  std::string what;
  std::optional<double> published{};
  std::optional<double> formula{};
  std::optional<double> simulated{};
  std::optional<double> berth{};
  std::optional<double> counted{};  ///< on a simulated bus, where the figure is no time
  const char* unit = "s";
  std::string note{};   ///< why the columns disagree
  std::string marks{};  ///< the frames that mark begin and end of the simulated time
  std::string trace{};  ///< name of its trace among `Figures::traces`; empty: none
};

struct NamedTrace {
  std::string name;  ///< "paper1-discovery", say: the file is NAME.log
  std::uint32_t bit_rate = 0;
  trace::Trace trace;
};

struct Figures {
  std::vector<Row> rows;
  std::vector<NamedTrace> traces;
  /// Runs that did not come to what they should: their figures are empty, and here is why, a line each. Each run's
  /// devices are held against the truth of the world (study/verdict.hpp).
  std::vector<std::string> wrong{};
};

/// All rows, ascending by paper. Takes about a second.
[[nodiscard]] Figures reproduce(const Conditions& conditions);

/// The traces that the papers print, made again: "paper1-figure9", "paper2-figure2", "paper2-table4", "paper4-table1",
/// "paper4-table2".
struct Listing {
  std::string name;
  std::string title;
  trace::Trace trace;
  enum class Form : std::uint8_t { messages, times, view } form = Form::messages;  ///< of study/words.hpp
  std::vector<std::string> wrong{};                                                ///< as in `Figures`
};
[[nodiscard]] const std::vector<std::string_view>& listings();
/// Empty: there is none of this name.
[[nodiscard]] std::optional<Listing> listing(std::string_view name, const Conditions& conditions);

/// @name The papers, one by one
/// @{
void reproduce_paper1(const Conditions& conditions, Figures& figures);
void reproduce_paper2(const Conditions& conditions, Figures& figures);
void reproduce_paper3(Figures& figures);
void reproduce_paper4(const Conditions& conditions, Figures& figures);
/// @}

}  // namespace berth::study
