/// The report of a gateway's own master on its node-IDs (5F0Bh, `manager::NodeIdReport`), read through the gateway and
/// put into text.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "berth/co/sdo_access.hpp"
#include "berth/manager/node_id_report.hpp"
#include "berth/places/slot.hpp"

namespace berth::tree {

class ListTrouble {
 public:
  struct Trouble {
    places::SlotState state = places::SlotState::empty;
    std::string reason;
    bool is_news = true;  ///< also if the slot already has this state with another reason
  };
  /// A look at all slaves begins: it asks once which of them have a report.
  void begin(rt::Time now) noexcept {
    now_ = now;
    troubled_ = {};
  }
  /// Why the slave `node` is not there. None: the master does not report it, or does not know. `path`: of the master,
  /// as commands name it.
  [[nodiscard]] rt::Task<std::optional<Trouble>> of(co::SdoAccess& master, const places::SlotSpec& slot,
                                                    std::string path);
  /// The devices without a place on the bus, as text; empty: none, already reported, or asked within the last ten
  /// seconds.
  [[nodiscard]] rt::Task<std::string> surplus(co::SdoAccess& master, bool any_fixed);

  /// Number of questions so far.
  [[nodiscard]] unsigned asked() const noexcept { return asked_; }

 private:
  [[nodiscard]] rt::Task<std::uint64_t> ask(co::SdoAccess& master, std::uint8_t sub);

  rt::Task<bool> is_troubled(co::SdoAccess& master, NodeId node);

  rt::Time now_{};
  rt::Time not_before_{};  // its master, or another device at a gateway's node-ID, answered: no such object
  std::array<std::optional<std::uint64_t>, 2> troubled_{};  // in this look
  unsigned asked_ = 0;
  rt::Time surplus_at_{};
  std::uint64_t surplus_ = 0;
};

}  // namespace berth::tree
