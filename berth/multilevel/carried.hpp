/// Which node beneath gateways a frame on the bus above is about, as a listener sees it who hears that bus alone: SDO
/// transfers to the three objects of a gateway (paper 3 Figures 11 to 13), to any depth, and emergencies with sub-nets
/// (Figures 7 to 9). Only the default identifiers (580h, 600h and 80h + node-ID).
///
///     multilevel::Carried carried(gateways);
///     const auto path = carried.about(frame);   // "3/5", or empty: the frame is about this bus's own
///
/// A node-ID or command that a client writes by block transfer is not read.
/// A listener that comes later than the write of a node-ID does not know whom the accesses after it are meant for,
/// until another is written. Memory is bounded: of a machine with more than `most_levels` gateways the rest is not
/// followed.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>

#include "berth/can/frame.hpp"
#include "berth/multilevel/emcy_layout.hpp"
#include "berth/multilevel/path.hpp"

namespace berth::multilevel {

class Carried {
 public:
  static constexpr std::size_t most_levels = 1024;

  /// `gateways`: node-IDs on this bus; other nodes' objects mean what they mean.
  explicit Carried(std::bitset<128> gateways, EmcyLayout layout = EmcyLayout::source_and_exit)
      : gateways_(gateways), layout_(layout) {}

  /// In the order of the bus. An emergency tells no port: its path has the first of each gateway's.
  [[nodiscard]] std::optional<Path> about(const can::Frame& frame);
  /// Gateways beneath gateways that are followed.
  [[nodiscard]] std::size_t levels() const noexcept { return levels_; }

 private:
  struct Gateway;
  /// What a gateway was told last for one of its buses beneath.
  struct Port {
    NodeId node;
    std::array<std::uint8_t, 4> data{};
    std::size_t bytes = 0;     // of `data`; 0: none, or more than an expedited transfer carries
    std::optional<Path> last;  // what its last command was about: the data belong to the same
    std::map<NodeId, std::unique_ptr<Gateway>> beneath;
  };
  struct Gateway {
    std::array<Port, most_ports> ports;
  };
  struct Channel {
    Gateway gateway;
    std::optional<Path> now;             // of the transfer that is under way
    bool in_blocks = false;              // its frames from the client are no commands
    ObjectRef object{};                  // of a segmented download,
    std::array<std::uint8_t, 4> data{};  // and what of it has come
    std::size_t bytes = 0;               // more than there is room for: none of them
  };
  using Data = std::optional<std::span<const std::uint8_t>>;  // empty: it is read

  void begin_download(NodeId node, Channel& channel, const can::Frame& frame);
  void segment(NodeId node, Channel& channel, const can::Frame& frame);
  std::optional<Path> emergency(const can::Frame& frame) const;
  void request(NodeId node, Channel& channel, const can::Frame& frame);
  std::optional<Path> access(Gateway& gateway, const Path& at, ObjectRef object, Data data);
  std::optional<Path> command(Port& port, const Path& at, std::span<const std::uint8_t> value);

  std::bitset<128> gateways_;
  EmcyLayout layout_;
  std::map<NodeId, Channel> channels_;
  std::size_t levels_ = 0;
};

}  // namespace berth::multilevel
