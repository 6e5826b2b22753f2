/// Which node each row of a trace is about, beneath gateways too, and whether `--node` wants it.
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
  /// `wanted`: empty is every node. `known` must stay.
  TraceNodes(const KnownNodes& known, std::vector<NodeView> wanted) : known_(&known), wanted_(std::move(wanted)) {}

  /// The log's next bus, as the machine names it; empty: not known.
  void add_bus(const std::string& machine_bus);
  /// Before the decoder sees it. Of a bus that was added.
  void look(const trace::Entry& entry);
  /// The node beneath gateways; empty: the bus's own. Of rows of the entry that was looked at last: of a transfer that
  /// broke off earlier it is not known.
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
