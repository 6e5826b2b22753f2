/// Sources of a trace's entries: a file, standard input, a growing file, a live port.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "output.hpp"
#include "trace.hpp"

namespace berth::cli {

class KnownNodes;

class TraceSource {
 public:
  virtual ~TraceSource() = default;
  enum class State : std::uint8_t { more, waiting, over };
  /// Passes available entries to the sink. waiting: there were none, and the call has waited for a short while.
  [[nodiscard]] virtual tl::expected<State, Failure> turn(trace::Sink& sink) = 0;
  /// At the end, wanted or not: completes what was begun.
  virtual void finish(trace::Sink& sink) = 0;
  [[nodiscard]] virtual const std::vector<std::string>& buses() const noexcept = 0;
  /// "candump", ...; "live".
  [[nodiscard]] virtual std::string format() const = 0;
};

/// Opens what the options name.
[[nodiscard]] tl::expected<std::unique_ptr<TraceSource>, Failure> open_source(const Options& options,
                                                                              const TraceOptions& trace,
                                                                              const KnownNodes& known);

}  // namespace berth::cli
