/// Two devices under one node-ID, as they leave the factory or come from two plants: each SDO request is answered
/// twice. LSS tells them apart when their addresses are known. What both say in 1018h is put together, part by part,
/// and each address that this may be is asked for by LSS, which needs no search and finds devices that no search finds
/// (CANopenNode's slaves with a node-ID answer 40h to 43h alone).
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "berth/operate/agenda.hpp"
#include "berth/operate/asking.hpp"

namespace berth::operate {

/// A second device may have the node-ID of this slot: the next round tells them apart.
void doubt_alone(Seat& seat, Agenda& agenda) noexcept;

class Duplicates final : public co::SdoClient::Observer {
 public:
  /// Hears second answers to SDO requests from now on.
  Duplicates(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Asking& asking) noexcept;

  /// Why such a slot does not run.
  static constexpr const char* reason = "two devices answer under this node-ID; take one of them off the bus";
  /// Tries in which a slot's device and another under its node-ID are told apart.
  static constexpr unsigned most_tries = 3;
  /// The devices that share each of these node-IDs; not again at once when that did not succeed. True: those of one
  /// are known now, and the plan gives each its own node-ID. The turn must be held.
  rt::Task<bool> tell_apart(std::vector<NodeId> ids);
  /// The same for slots of which `Seat::shared` says that two devices may have their node-ID.
  rt::Task<void> tell_seats_apart();

 private:
  struct Shared {
    NodeId id;
    std::array<std::vector<std::uint32_t>, 4> parts{};    // of the LSS addresses that were heard under it
    std::array<std::vector<std::uint32_t>, 4> seconds{};  // those of them that came as second answers
    std::optional<rt::Time> second_at = std::nullopt;     // the last one
    bool answered_twice = false;                          // that is no frame which CAN repeated
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
  std::array<rt::Time, 128> not_before_{};  // they are not told apart again
  struct Twice {
    rt::Time last{};
    unsigned times = 0;
  };
  std::array<Twice, 128> answered_twice_{};  // of nodes without a slot
};

}  // namespace berth::operate
