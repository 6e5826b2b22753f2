/// The wire form of a payload: Google Protocol Buffers (Sparkplug 3.0 §6.4.1, `sparkplug_b.proto`).
#pragma once

#include <span>

#include "berth/sparkplug/payload.hpp"

namespace berth::sparkplug {

/// What `decode` accepts at most. A byte of input may take some fifty of memory while it is read.
struct DecodeLimits {
  std::size_t bytes = 512 * 1024;
  /// Metrics, cells of data sets, properties and parameters, nested ones too.
  std::size_t items = 20'000;
  /// Messages within messages; a template within a template takes two.
  int depth = 16;
};

/// Whether metrics say their data types. They decide how a value is written either way; messages after a birth leave
/// the numbers out (§6.4.6).
enum class Types : std::uint8_t { written, left_out };

/// Never fails: what a value does not fit (`fits`) is written as null.
[[nodiscard]] Bytes encode(const Payload& payload, Types types = Types::written);

/// `invalid`: not a payload (bytes that are no protocol buffer or nest too deeply, a name, key or reference that is no
/// UTF-8). `exhausted`: more than `limits` allow. The error's text says which. One value that cannot be used is
/// `Unsupported` in its place and no error.
[[nodiscard]] Result<Payload> decode(std::span<const std::uint8_t> bytes, const DecodeLimits& limits = {});

}  // namespace berth::sparkplug
