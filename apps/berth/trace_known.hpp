/// What the machine file and device descriptions know of the nodes in a trace.
#pragma once

#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/decode/decoder.hpp"
#include "berth/design/machine.hpp"
#include "output.hpp"
#include "trace.hpp"

namespace berth::cli {

class KnownNodes {
 public:
  /// Reads everything that the options name. What cannot be read is the failure.
  [[nodiscard]] static tl::expected<KnownNodes, Failure> load(const Options& options, const TraceOptions& trace);

  /// The machine's bus that a log's bus is: of the same name, or at that port, or the only one. Empty: none.
  [[nodiscard]] std::string machine_bus(const std::string& log_name) const;
  /// Tells the decoder of every node of a log's bus.
  void tell(decode::Decoder& decoder, std::uint16_t bus, const std::string& log_name) const;
  [[nodiscard]] const std::optional<design::Machine>& machine() const noexcept { return machine_; }

 private:
  struct Known {
    std::string bus;  // the machine's; empty: any
    NodeId node;
    decode::Profile profile;
  };
  [[nodiscard]] std::optional<Failure> add_machine(const std::string& path);
  [[nodiscard]] std::optional<Failure> add_eds(const std::string& text, const TraceOptions& trace);

  std::optional<design::Machine> machine_;
  std::vector<Known> nodes_;
};

}  // namespace berth::cli
