/// What the machine file and device descriptions say about the nodes in a trace.
#pragma once

#include <bitset>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/decode/decoder.hpp"
#include "berth/design/machine.hpp"
#include "berth/multilevel/path.hpp"
#include "options.hpp"
#include "output.hpp"
#include "trace.hpp"

namespace berth::cli {

/// A node that `--node` selects, as seen from one bus: on it, or beneath its gateways.
struct NodeView {
  std::string bus = {};  ///< the machine's; empty: any
  multilevel::Path path;

  /// `about`: the node beneath that the frame is for; `ports_told`: false for an emergency, which names no ports.
  [[nodiscard]] bool has(const std::string& machine_bus, unsigned node, const std::optional<multilevel::Path>& about,
                         bool ports_told) const;
};

class KnownNodes {
 public:
  /// Reads everything that the options name; fails if something cannot be read.
  [[nodiscard]] static tl::expected<KnownNodes, Failure> load(const Options& options, const TraceOptions& trace);

  /// The machine's bus for a log's bus: the one with the same name, or at that port, or the only one. Empty: none.
  [[nodiscard]] std::string machine_bus(const std::string& log_name) const;
  /// The nodes that `--node` selects: "5" on any bus; "3/5" and a slot's name on every bus from the top one down.
  [[nodiscard]] tl::expected<std::vector<NodeView>, Failure> views(const std::vector<std::string>& words) const;
  /// The machine's gateways on this of its buses.
  [[nodiscard]] std::bitset<128> gateways(const std::string& machine_bus) const;
  /// Gives the decoder every node of a log's bus.
  void tell(decode::Decoder& decoder, std::uint16_t bus, const std::string& log_name) const;
  [[nodiscard]] const std::optional<design::Machine>& machine() const noexcept { return machine_; }

 private:
  [[nodiscard]] tl::expected<std::vector<NodeView>, Failure> views(const std::string& word) const;
  [[nodiscard]] std::vector<NodeView> views_from(const design::Bus& top, const multilevel::Path& path) const;
  struct Known {
    std::string bus;  // the machine's; empty: any
    NodeId node;
    decode::Profile profile;
  };
  [[nodiscard]] std::optional<Failure> add_machine(const Options& options);
  void add_links();
  [[nodiscard]] std::optional<Failure> add_eds(const std::string& text, const TraceOptions& trace);

  std::optional<design::Machine> machine_;
  std::vector<Known> nodes_;
};

}  // namespace berth::cli
