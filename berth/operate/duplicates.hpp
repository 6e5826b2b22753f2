/// Two devices under one node-ID, from the factory or from two plants: each SDO request gets two answers. LSS can
/// separate the devices when their addresses are known. Berth collects the parts of 1018h that both report and asks by
/// LSS for each address that these parts can form. This needs no search, and finds devices that no search finds
/// (CANopenNode's slaves with a node-ID answer only 40h to 43h).
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "berth/operate/agenda.hpp"
#include "berth/operate/asking.hpp"

namespace berth::operate {

/// A second device may have this slot's node-ID: the next round tries to separate the two.
void doubt_alone(Seat& seat, Agenda& agenda) noexcept;

class Duplicates final : public co::SdoClient::Observer {
 public:
  /// Receives second answers to SDO requests from now on.
  Duplicates(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Asking& asking) noexcept;

  /// Why such a slot does not run.
  static constexpr const char* reason = "two devices answer under this node-ID; take one of them off the bus";
  /// How often Berth tries to separate a slot's device from another under its node-ID.
  static constexpr unsigned most_tries = 3;
  /// Identifies the devices that share each of these node-IDs; after a failure it waits before it tries that node-ID
  /// again. True: the devices of at least one node-ID are known, and the plan gives each its own. The turn must be
  /// held.
  rt::Task<bool> tell_apart(std::vector<NodeId> ids);
  /// The same for slots whose `Doubt::shared` says that two devices may have their node-ID.
  rt::Task<void> tell_seats_apart();

 private:
  struct Shared {
    NodeId id;
    std::array<std::vector<std::uint32_t>, 4> parts{};    // of the LSS addresses that were heard under it
    std::array<std::vector<std::uint32_t>, 4> seconds{};  // those of them that came as second answers
    std::optional<rt::Time> second_at = std::nullopt;     // the last one
    bool answered_twice = false;                          // and not because CAN repeated a frame
  };
  void surplus(NodeId node, const can::Frame& frame, rt::Time at) noexcept override;
  void note_shared(const can::Frame& frame, rt::Time at);
  void tell(NodeId node);
  rt::Task<void> hear_parts(NodeId id);
  [[nodiscard]] static std::vector<Identity> addresses_of(const Shared& shared);
  rt::Task<void> ask_addresses(NodeId id, std::vector<Identity> addresses, bool slowly);
  enum class Distinction : std::uint8_t { nothing, two, known };
  rt::Task<Distinction> tell_one_apart(NodeId id);

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Asking& asking_;
  std::optional<Shared> shared_;            // while two devices are told apart
  std::array<rt::Time, 128> not_before_{};  // they are not separated again before this time
  struct Twice {
    rt::Time last{};
    unsigned times = 0;
  };
  std::array<Twice, 128> answered_twice_{};  // of nodes without a slot
};

}  // namespace berth::operate
