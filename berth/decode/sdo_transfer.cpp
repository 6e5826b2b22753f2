#include "berth/decode/sdo_transfer.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"

namespace berth::decode {
namespace {

using Mode = SdoRecord::Mode;
using End = SdoRecord::End;

constexpr std::uint8_t abort_specifier = 0x80;

ObjectRef object_of(const can::Frame& frame) noexcept {
  return {load_le<std::uint16_t>(frame.data.data() + 1), frame.data[3]};
}

}  // namespace

void SdoTransfer::frame(const can::Frame& frame, bool request, rt::Duration at, Listener& listener) {
  at_ = at;
  const bool sends = record_.write == request;  // this side sends the data
  if (stage_ == Stage::block_data && sends && frame.data[0] != abort_specifier) return block_segment(frame);
  if (frame.data[0] >> 5 == 4) return abort(frame, request, listener);
  if (request) {
    client(frame, listener);
  } else {
    server(frame, listener);
  }
}

void SdoTransfer::client(const can::Frame& frame, Listener& listener) {
  const std::uint8_t command = frame.data[0];
  switch (command >> 5) {
    case 1:
      begin(frame, true, (command & 2U) != 0 ? Mode::expedited : Mode::segmented, listener);
      if (record_.mode == Mode::segmented) {
        if ((command & 1U) != 0) record_.announced = load_le<std::uint32_t>(frame.data.data() + 4);
        return;
      }
      record_.sized = (command & 1U) != 0;
      append(frame.data.data() + 4, record_.sized ? 4U - (command >> 2 & 3U) : 4U);
      return;
    case 2: return begin(frame, false, Mode::expedited, listener);
    case 0:
    case 3:
      if (stage_ != Stage::segments || record_.write != (command >> 5 == 0)) return stray(frame, false, listener);
      if (record_.write) return segment(frame);
      ++record_.frames;
      record_.last = at_;
      return;
    case 5:
      if ((command & 3U) == 0) return begin(frame, false, Mode::block, listener);
      break;
    case 6:
      if ((command & 1U) == 0) {
        begin(frame, true, Mode::block, listener);
        if ((command & 2U) != 0) record_.announced = load_le<std::uint32_t>(frame.data.data() + 4);
        return;
      }
      break;
    default: return stray(frame, false, listener);
  }
  // The client's frames within a block transfer.
  if (stage_ == Stage::idle || record_.mode != Mode::block) return stray(frame, false, listener);
  ++record_.frames;
  record_.last = at_;
  if (command >> 5 == 6) return cut_to(record_.length - std::min<std::uint64_t>(record_.length, command >> 2 & 7U));
  if ((command & 3U) == 3) {
    stage_ = Stage::block_data;
  } else if ((command & 3U) == 2) {
    acknowledged(frame.data[1]);
  } else {
    end(End::done, listener);
  }
}

void SdoTransfer::server(const can::Frame& frame, Listener& listener) {
  const std::uint8_t command = frame.data[0];
  const bool initiates = command >> 5 == 2 || command >> 5 == 3 || (command >> 5 == 5 && (command & 3U) == 0) ||
                         (command >> 5 == 6 && (command & 1U) == 0);
  if (initiates) return initiated(frame, listener);
  if (command >> 5 <= 1) {
    if (stage_ != Stage::segments || record_.write != (command >> 5 == 1)) return stray(frame, false, listener);
    if (!record_.write) {
      segment(frame);
    } else {
      ++record_.frames;
      record_.last = at_;
    }
    if (last_segment_) end(End::done, listener);
    return;
  }
  if (command >> 5 > 6 || stage_ == Stage::idle || record_.mode != Mode::block) return stray(frame, false, listener);
  ++record_.frames;
  record_.last = at_;
  if (command >> 5 == 6) return cut_to(record_.length - std::min<std::uint64_t>(record_.length, command >> 2 & 7U));
  if ((command & 3U) == 2) {
    acknowledged(frame.data[1]);
  } else {
    end(End::done, listener);
  }
}

// The server's answer to the client's initiate.
void SdoTransfer::initiated(const can::Frame& frame, Listener& listener) {
  const std::uint8_t command = frame.data[0];
  const bool to_write = command >> 5 == 3 || command >> 5 == 5;
  if (stage_ != Stage::asked || object_of(frame) != record_.object || record_.write != to_write)
    return stray(frame, true, listener);
  ++record_.frames;
  record_.last = at_;
  switch (command >> 5) {
    case 2:  // also as the answer to a block upload: the server changed the protocol
      if ((command & 2U) != 0) {
        record_.mode = Mode::expedited;
        record_.sized = (command & 1U) != 0;
        append(frame.data.data() + 4, record_.sized ? 4U - (command >> 2 & 3U) : 4U);
        return end(End::done, listener);
      }
      record_.mode = Mode::segmented;
      if ((command & 1U) != 0) record_.announced = load_le<std::uint32_t>(frame.data.data() + 4);
      stage_ = Stage::segments;
      return;
    case 3:
      if (record_.mode == Mode::expedited) return end(End::done, listener);
      stage_ = Stage::segments;
      return;
    case 5: stage_ = Stage::block_data; return;
    default:
      if ((command & 2U) != 0) record_.announced = load_le<std::uint32_t>(frame.data.data() + 4);
  }
}

void SdoTransfer::begin(const can::Frame& frame, bool write, Mode mode, Listener& listener) {
  finish(listener);
  record_.object = object_of(frame);
  record_.write = write;
  record_.mode = mode;
  record_.abort = 0;
  record_.sized = record_.has_object = true;
  record_.length = 0;
  record_.bytes.clear();
  record_.announced.reset();
  record_.frames = 1;
  record_.began = record_.last = at_;
  stage_ = Stage::asked;
  last_segment_ = false;
  toggle_ = 0;
  next_ = 1;
  block_began_ = 0;
}

void SdoTransfer::abort(const can::Frame& frame, bool request, Listener& listener) {
  if (stage_ == Stage::idle) {
    begin(frame, false, Mode::expedited, listener);
  } else {
    ++record_.frames;
    record_.last = at_;
  }
  record_.abort = load_le<std::uint32_t>(frame.data.data() + 4);
  end(request ? End::aborted_by_client : End::aborted_by_server, listener);
}

// A repeated segment has the same toggle bit as the one before.
void SdoTransfer::segment(const can::Frame& frame) {
  ++record_.frames;
  record_.last = at_;
  if ((frame.data[0] & 0x10U) != toggle_) return;
  toggle_ ^= 0x10U;
  append(frame.data.data() + 1, 7U - (frame.data[0] >> 1 & 7U));
  last_segment_ = (frame.data[0] & 1U) != 0;
}

void SdoTransfer::block_segment(const can::Frame& frame) {
  ++record_.frames;
  record_.last = at_;
  if ((frame.data[0] & 0x7FU) != next_) return;  // one is missing: it will be sent again
  ++next_;
  append(frame.data.data() + 1, 7);
  last_segment_ = (frame.data[0] & 0x80U) != 0;
}

// Segments that were not acknowledged are sent again in the next sub-block.
void SdoTransfer::acknowledged(unsigned count) {
  if (count + 1U < next_) {
    cut_to(block_began_ + 7U * count);
    last_segment_ = false;
  }
  block_began_ = record_.length;
  next_ = 1;
  if (last_segment_) stage_ = Stage::block_end;
}

void SdoTransfer::stray(const can::Frame& frame, bool with_object, Listener& listener) {
  // It gets a record of its own, so that it does not disturb the transfer in progress.
  SdoRecord lone;
  lone.object = with_object ? object_of(frame) : ObjectRef{};
  lone.has_object = with_object;
  lone.end = End::stray;
  lone.frames = 1;
  lone.began = lone.last = at_;
  listener.ended(lone);
}

void SdoTransfer::finish(Listener& listener) {
  if (stage_ != Stage::idle) end(End::unfinished, listener);
}

void SdoTransfer::end(End how, Listener& listener) {
  record_.end = how;
  stage_ = Stage::idle;
  listener.ended(record_);
}

void SdoTransfer::append(const std::uint8_t* from, std::size_t count) {
  if (record_.bytes.size() == record_.length) {
    const auto room = std::min(count, SdoRecord::most_kept - record_.bytes.size());
    record_.bytes.insert(record_.bytes.end(), from, from + room);
  }
  record_.length += count;
}

void SdoTransfer::cut_to(std::uint64_t length) {
  record_.length = length;
  if (record_.bytes.size() > length) record_.bytes.resize(static_cast<std::size_t>(length));
}

}  // namespace berth::decode
