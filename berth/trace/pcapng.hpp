/// PCAP Next Generation (draft-ietf-opsawg-pcapng) with CAN frames: link type 227, LINKTYPE_CAN_SOCKETCAN, as
/// Wireshark, tcpdump and dumpcap write it on SocketCAN interfaces.
///
/// Read: both byte orders, several sections and interfaces, enhanced, simple and (obsolete) packet blocks, if_name,
/// if_tsresol (powers of ten and of two), if_tsoffset, the direction in epb_flags. Comments and every other option and
/// block are ignored. An interface of another link type is a note, and its packets are left out. A packet's 227
/// payload: identifier U32 big-endian with SocketCAN's flags (8000 0000h extended, 4000 0000h remote, 2000 0000h
/// error), length U8, FD flags U8 (1 BRS, 2 ESI, 4 FD), two bytes reserved, data.
///
/// An impossible block is an error with its byte; then the reader looks for the next place that looks like a block.
/// Written: one section, little-endian, one interface per bus with its name and nanoseconds. Nothing is lost.
#pragma once

#include <string>
#include <vector>

#include "berth/trace/captured.hpp"
#include "berth/trace/stream.hpp"

namespace berth::trace {

class PcapngReader final : public Reader {
 public:
  static constexpr std::uint32_t longest_block = 1U << 20U;  ///< of blocks that are read

  explicit PcapngReader(std::string file) : file_(std::move(file)) {}
  void feed(std::string_view bytes, Sink& sink) override;
  void finish(Sink& sink) override;

 private:
  struct Interface {
    bool can = false;
    LinkType link = LinkType::other;
    bool told = false;              // that it is not CAN
    std::uint16_t bus = 0;          // index of `buses_`
    std::uint32_t snap_length = 0;  // 0: no limit
    std::uint8_t resolution = 6;    // as if_tsresol
    std::int64_t offset = 0;        // seconds
  };
  struct Packet {
    std::uint32_t interface = 0;
    std::uint64_t time = 0;  // in the interface's unit
    bool timed = true;
    std::uint32_t captured = 0;
    std::size_t data = 0;  // where the bytes begin in the block
  };

  [[nodiscard]] std::size_t consume(std::string_view bytes);
  [[nodiscard]] std::size_t step(std::string_view bytes);
  [[nodiscard]] std::size_t lose(std::string message);
  [[nodiscard]] bool plausible(std::string_view bytes) const noexcept;
  void block(std::uint32_t type, std::string_view block);
  void section(std::string_view block);
  void interface(std::string_view block);
  void enhanced(std::string_view block);
  void simple(std::string_view block);
  void obsolete(std::string_view block);
  void packet(const Packet& packet, std::string_view block);
  [[nodiscard]] std::optional<rt::Duration> time(const Interface& interface, std::uint64_t count) const noexcept;
  template <class F>
  void options(std::string_view bytes, F each);
  [[nodiscard]] std::uint16_t u16(std::string_view bytes, std::size_t at) const noexcept;
  [[nodiscard]] std::uint32_t u32(std::string_view bytes, std::size_t at) const noexcept;
  [[nodiscard]] std::uint64_t u64(std::string_view bytes, std::size_t at) const noexcept;
  void tell(Finding::Severity severity, std::string message, std::string fix = {});

  std::string file_;
  std::string rest_;           // of a block that is not complete yet
  std::size_t needed_ = 12;    // its bytes that are needed for the next step
  std::uint64_t offset_ = 0;   // in the file, of the present block
  std::uint64_t passing_ = 0;  // bytes left of a block that is skipped
  bool lost_ = false;          // looking for the next block
  bool unsure_ = false;        // no complete block since then
  bool big_endian_ = false;
  bool in_section_ = false;
  std::vector<Interface> interfaces_;  // of the section
  Entry entry_;
  Sink* sink_ = nullptr;
};

class PcapngWriter final : public Writer {
 public:
  void write(const Entry& entry, std::string_view bus, std::string& out) override;
  void finish(std::string& out) override;

 private:
  void begin(std::string& out);
  [[nodiscard]] std::uint32_t interface(std::uint16_t bus, std::string_view name, std::string& out);

  bool begun_ = false;
  std::uint32_t interfaces_ = 0;
  std::vector<std::uint32_t> numbers_;  // by bus, of its interface + 1
};

}  // namespace berth::trace
