/// `berth trace --ring`: the frames that a running process keeps for Studio. It asks the control socket for them in
/// parts, up to the newest frame at the first request.
#pragma once

#include <memory>
#include <tl/expected.hpp>

#include "trace_source.hpp"

namespace berth::cli {

[[nodiscard]] tl::expected<std::unique_ptr<TraceSource>, Failure> open_ring(const Options& options,
                                                                            const TraceOptions& trace,
                                                                            const KnownNodes& known);

}  // namespace berth::cli
