/// `berth trace --ring`: the frames that a running process has kept for Studio, asked of its control socket part by
/// part, up to those that were the newest when it was first asked.
#pragma once

#include <memory>
#include <tl/expected.hpp>

#include "trace_source.hpp"

namespace berth::cli {

[[nodiscard]] tl::expected<std::unique_ptr<TraceSource>, Failure> open_ring(const Options& options,
                                                                            const TraceOptions& trace,
                                                                            const KnownNodes& known);

}  // namespace berth::cli
