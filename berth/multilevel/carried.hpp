/// Finds which node beneath gateways a frame on the bus above is about, for a listener on that bus alone. It reads SDO
/// transfers to the three objects of a gateway (paper 3 Figures 11 to 13), to any depth, and emergencies with sub-nets
/// (Figures 7 to 9). Only the default identifiers (580h, 600h and 80h + node-ID).
///
///     multilevel::Carried carried(gateways);
///     const auto path = carried.about(frame);   // "3/5", or empty: the frame is about this bus's own
///
/// A node-ID or command written by block transfer is not read. A listener that joins after a node-ID was written cannot
/// assign the following accesses until the next one is written. Memory is bounded: of a machine with more than
/// `most_levels` gateways the rest is not followed.
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

  /// `gateways`: node-IDs on this bus. The same objects of other nodes have their usual meaning.
  explicit Carried(std::bitset<128> gateways, EmcyLayout layout = EmcyLayout::source_and_exit)
      : gateways_(gateways), layout_(layout) {}

  /// Call it in the order of the bus. An emergency names no port: its path has each gateway's first one.
  [[nodiscard]] std::optional<Path> about(const can::Frame& frame);
  /// Gateways beneath gateways that are followed.
  [[nodiscard]] std::size_t levels() const noexcept { return levels_; }

 private:
  struct Gateway;
  /// The last accesses to a gateway for one of its buses beneath.
  struct Port {
    NodeId node;
    std::array<std::uint8_t, 4> data{};
    std::size_t bytes = 0;     // of `data`; 0: none, or more than an expedited transfer carries
    std::optional<Path> last;  // node of its last command: the data belong to the same
    std::map<NodeId, std::unique_ptr<Gateway>> beneath;
  };
  struct Gateway {
    std::array<Port, most_ports> ports;
  };
  struct Channel {
    Gateway gateway;
    std::optional<Path> now;             // of the transfer in progress
    bool in_blocks = false;              // the client's frames are not commands
    ObjectRef object{};                  // of a segmented download,
    std::array<std::uint8_t, 4> data{};  // and its bytes so far
    std::size_t bytes = 0;               // more than there is room for: none is kept
  };
  using Data = std::optional<std::span<const std::uint8_t>>;  // empty: the object is read

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
