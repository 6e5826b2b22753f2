/// Where a trace's entries come from: a file, standard input, a file that grows, a live port.
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
  /// Brings what is there to the sink. waiting: nothing now; the call has waited for a short while.
  [[nodiscard]] virtual tl::expected<State, Failure> turn(trace::Sink& sink) = 0;
  /// No more is wanted, or there is no more: what was begun is ended.
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
