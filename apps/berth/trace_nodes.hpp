/// Which node each row of a trace is about, including nodes beneath gateways, and whether `--node` selects it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/decode/decoder.hpp"
#include "berth/multilevel/carried.hpp"
#include "trace_known.hpp"

namespace berth::cli {

class TraceNodes {
 public:
  /// `wanted`: empty means every node. `known` must outlive it.
  TraceNodes(const KnownNodes& known, std::vector<NodeView> wanted) : known_(&known), wanted_(std::move(wanted)) {}

  /// The log's next bus, as the machine names it; empty: unknown.
  void add_bus(const std::string& machine_bus);
  /// Call it before the decoder sees the entry. Its bus must have been added.
  void look(const trace::Entry& entry);
  /// The node beneath gateways; empty: on the bus itself. For rows of the entry looked at last: for a transfer that
  /// broke off earlier it is unknown.
  [[nodiscard]] std::optional<multilevel::Path> about(const decode::Row& row) const;
  [[nodiscard]] bool wants(const decode::Row& row) const;

 private:
  struct Bus {
    std::string name;
    multilevel::Carried carried;
  };
  const KnownNodes* known_;
  std::vector<NodeView> wanted_;
  std::vector<Bus> buses_;
  std::optional<multilevel::Path> about_;
  rt::Duration now_{};
};

}  // namespace berth::cli
