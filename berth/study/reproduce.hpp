/// `berth reproduce`: every figure that papers 1, 2 and 4 print for finding devices and giving them node-IDs, and paper
/// 3's numbers of nodes and accesses. Each is given as published, by formula, simulated on the bit-exact bus, and for
/// the same job by Berth's own code: found by its planners, bound by `places::Binder`.
///
/// Formula and simulation are independent: the formula is arithmetic with frame lengths, time-outs and the conditions;
/// the simulation runs the procedure on devices that answer. A simulated time is the span of a recorded trace, from the
/// end of its first frame to the end of its last, as `berth trace --stats` prints it. If a procedure ends (or begins)
/// with silence, the mark is a heartbeat of the master, 77F#05; the row's `marks` names the frames.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/rt/executor.hpp"
#include "berth/trace/trace.hpp"

namespace berth::study {

/// What the user sets; empty: as in the paper.
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
  std::optional<double> counted{};  ///< on a simulated bus, if the figure is not a time
  const char* unit = "s";
  std::string note{};   ///< why the columns differ
  std::string marks{};  ///< the frames at the begin and end of the simulated time
  std::string trace{};  ///< name of its trace among `Figures::traces`; empty: none
};

struct NamedTrace {
  std::string name;  ///< such as "paper1-discovery": the file is NAME.log
  std::uint32_t bit_rate = 0;
  trace::Trace trace;
};

struct Figures {
  std::vector<Row> rows;
  std::vector<NamedTrace> traces;
  /// Failed runs, whose figures are empty: the reasons, one line each. Each run's devices are compared with the world's
  /// truth (study/verdict.hpp).
  std::vector<std::string> wrong{};
};

/// All rows, ascending by paper. Takes about a second.
[[nodiscard]] Figures reproduce(const Conditions& conditions);

/// The reproduced traces of the papers: "paper1-figure9", "paper2-figure2", "paper2-table4", "paper4-table1",
/// "paper4-table2".
struct Listing {
  std::string name;
  std::string title;
  trace::Trace trace;
  enum class Form : std::uint8_t { messages, times, view } form = Form::messages;  ///< see study/words.hpp
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
