/// A source or sink of an SDO client's transfer, with its buffer: a part of `SdoClientData`, on the heap because most
/// transfers have none.
#pragma once

#include "berth/co/sdo_block.hpp"
#include "berth/co/sdo_read_ahead.hpp"
#include "berth/co/sdo_stream.hpp"

namespace berth::co {

struct SdoClientStream {
  [[nodiscard]] SdoPace& pace() noexcept { return source != nullptr ? static_cast<SdoPace&>(*source) : *sink; }

  SdoSource* source = nullptr;
  SdoSink* sink = nullptr;
  ReadAhead ahead;
  std::array<std::uint8_t, sdo::block_window> stash;  ///< of a source: read ahead; of a sink: the sub-block
  bool touched = false;                               ///< bytes were read from the source
};

}  // namespace berth::co
