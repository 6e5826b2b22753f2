/// Classic pcap (tcpdump, tshark -F pcap): a header of 24 bytes, then packets of one interface, each with a header of
/// 16. Read only: pcapng (pcapng.hpp) is what is written. Either byte order, microseconds or nanoseconds; link types
/// of captured.hpp. The bus has no name in the file: can0.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "berth/trace/captured.hpp"
#include "berth/trace/stream.hpp"

namespace berth::trace {

/// The first bytes of a file in this format.
[[nodiscard]] bool is_pcap(std::string_view head) noexcept;

class PcapReader final : public Reader {
 public:
  /// Bytes of a packet; CAN packets are far smaller.
  static constexpr std::uint32_t longest_packet = 1U << 18U;

  explicit PcapReader(std::string file) : file_(std::move(file)) {}
  void feed(std::string_view bytes, Sink& sink) override;
  void finish(Sink& sink) override;

 private:
  [[nodiscard]] std::size_t step(std::string_view bytes);
  void head(std::string_view bytes);
  void packet(std::string_view bytes);
  [[nodiscard]] std::uint32_t u32(std::string_view bytes, std::size_t at) const noexcept;
  void tell(Finding::Severity severity, std::string message);

  std::string file_;
  std::string rest_;          // of a packet that is not complete yet
  std::uint64_t offset_ = 0;  // in the file, of the present bytes
  bool begun_ = false;        // the header was read
  bool over_ = false;         // nothing more can be read
  bool big_endian_ = false;
  bool nanoseconds_ = false;
  LinkType link_ = LinkType::other;
  Entry entry_;
  Sink* sink_ = nullptr;
};

}  // namespace berth::trace
