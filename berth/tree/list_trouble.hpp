/// What a gateway's own master tells of the node-IDs that it gives (5F0Bh, `manager::NodeIdReport`), read through the
/// gateway and put in words.
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
    bool is_news = true;  ///< also where the slot has this state already, and another reason
  };
  /// A look at all slaves begins: which of them its master has something to tell of is asked once in it.
  void begin(rt::Time now) noexcept {
    now_ = now;
    troubled_ = {};
  }
  /// Why the slave `node` is not there. None: the master does not tell, or knows nothing. `path`: of the master, as
  /// commands name it.
  [[nodiscard]] rt::Task<std::optional<Trouble>> of(co::SdoAccess& master, const places::SlotSpec& slot,
                                                    std::string path);
  /// The devices that have no place on the bus, in words; empty: there is none, it was told already, or it was asked
  /// for within the last ten seconds.
  [[nodiscard]] rt::Task<std::string> surplus(co::SdoAccess& master, bool any_fixed);

  /// Questions so far.
  [[nodiscard]] unsigned asked() const noexcept { return asked_; }

 private:
  [[nodiscard]] rt::Task<std::uint64_t> ask(co::SdoAccess& master, std::uint8_t sub);

  rt::Task<bool> is_troubled(co::SdoAccess& master, NodeId node);

  rt::Time now_{};
  rt::Time not_before_{};  // its master, or another device under a gateway's node-ID, said that it has no such object
  std::array<std::optional<std::uint64_t>, 2> troubled_{};  // in this look
  unsigned asked_ = 0;
  rt::Time surplus_at_{};
  std::uint64_t surplus_ = 0;
};

}  // namespace berth::tree
