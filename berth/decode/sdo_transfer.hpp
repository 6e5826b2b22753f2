/// Combines the frames of one SDO channel into transfers (CiA 301 §7.2.4): expedited, segmented, block, read and
/// write, for a listener that hears both sides and knows nothing else. Frames may be missing, repeated or wrong.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::decode {

struct SdoRecord {
  /// Only the first bytes of a longer value are kept.
  static constexpr std::size_t most_kept = 4096;
  enum class Mode : std::uint8_t { expedited, segmented, block };
  enum class End : std::uint8_t {
    done,
    aborted_by_client,
    aborted_by_server,
    unfinished,  ///< the client began another, or the trace ended
    stray,       ///< a frame that belongs to no transfer whose begin was seen
  };

  ObjectRef object{};
  bool write = false;
  Mode mode = Mode::expedited;
  End end = End::unfinished;
  std::uint32_t abort = 0;                 ///< the code, when aborted
  bool sized = true;                       ///< false: expedited without a size; all four bytes are there
  bool has_object = true;                  ///< false: a stray segment, whose object is unknown
  std::uint64_t length = 0;                ///< bytes transferred
  std::vector<std::uint8_t> bytes;         ///< the first of them
  std::optional<std::uint64_t> announced;  ///< the size that its sender indicated
  unsigned frames = 0;
  rt::Duration began{};
  rt::Duration last{};
};

class SdoTransfer {
 public:
  class Listener {
   public:
    /// The record is valid during the call only.
    virtual void ended(const SdoRecord& record) = 0;

   protected:
    ~Listener() = default;
  };

  /// A data frame of eight bytes on the channel: from the client (`request`) or the server. Calls the listener for each
  /// transfer that it ends.
  void frame(const can::Frame& frame, bool request, rt::Duration at, Listener& listener);
  /// The trace is over.
  void finish(Listener& listener);
  /// A transfer has begun and not ended.
  [[nodiscard]] bool busy() const noexcept { return stage_ != Stage::idle; }

 private:
  enum class Stage : std::uint8_t { idle, asked, segments, block_data, block_end };
  void client(const can::Frame& frame, Listener& listener);
  void server(const can::Frame& frame, Listener& listener);
  void begin(const can::Frame& frame, bool write, SdoRecord::Mode mode, Listener& listener);
  void initiated(const can::Frame& frame, Listener& listener);
  void abort(const can::Frame& frame, bool request, Listener& listener);
  void segment(const can::Frame& frame);
  void block_segment(const can::Frame& frame);
  void acknowledged(unsigned count);
  void stray(const can::Frame& frame, bool with_object, Listener& listener);
  void end(SdoRecord::End how, Listener& listener);
  void append(const std::uint8_t* from, std::size_t count);
  void cut_to(std::uint64_t length);

  SdoRecord record_;
  Stage stage_ = Stage::idle;
  bool last_segment_ = false;
  std::uint8_t toggle_ = 0;        // of the next segment: 0 or 10h
  std::uint8_t next_ = 1;          // of a block: sequence number of the next segment
  std::uint64_t block_began_ = 0;  // length when the sub-block began
  rt::Duration at_{};
};

}  // namespace berth::decode
