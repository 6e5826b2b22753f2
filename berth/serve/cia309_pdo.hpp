/// The PDOs of a CiA 309-3 gateway on one network: no objects, only values. A conversation has its own.
///
/// An RPDO is received by the gateway: each reception (types SYNC: the next SYNC after it) calls `Ear::received`. A
/// frame shorter than mapped is ignored; of a longer one the first bytes are used. A TPDO is sent by the gateway: type
/// event when it is written, after a running inhibit time, and again by the event timer; type rtr on a remote frame;
/// types SYNC with the next, or every n-th, SYNC; always only after the first write. Values are bit rows of their
/// type's length, the first in the lowest bits of the first byte (CiA 301 §7.4.7).
#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/cob_id.hpp"
#include "berth/serve/cia309.hpp"

namespace berth::serve::cia309 {

class Pdos final : private can::Handler, private rt::Job {
 public:
  class Ear {
   public:
    virtual void received(std::uint16_t number, std::span<const std::uint64_t> values) noexcept = 0;

   protected:
    ~Ear() = default;
  };
  Pdos(can::Dispatcher& dispatcher, Ear& ear) : dispatcher_(&dispatcher), ear_(&ear) {}

  /// `pdo_length`: more than 64 bits. `pdo_used`: another PDO of this conversation has this CAN-ID. `internal_state`: a
  /// CAN-ID that PDOs may not use. A setting whose COB-ID has bit 31 removes the PDO.
  std::optional<Code> set_rpdo(const PdoSetting& setting);
  std::optional<Code> set_tpdo(const PdoSetting& setting);
  /// A TPDO sends with this key.
  [[nodiscard]] bool sends(std::uint32_t key) const noexcept;
  [[nodiscard]] const can::Dispatcher& dispatcher() const noexcept { return *dispatcher_; }

  /// The present state of an RPDO.
  struct State {
    std::span<const std::uint64_t> values{};  ///< empty before the first reception
    std::uint64_t receptions = 0;
    bool by_request = false;  ///< type rtr
  };
  /// Empty: no RPDO has this number.
  [[nodiscard]] std::optional<State> rpdo(std::uint16_t number) const noexcept;
  /// Asks for an RPDO by a remote frame.
  can::Queued ask(std::uint16_t number) noexcept;

  struct Written {
    std::optional<Code> error{};  ///< `internal_state`: no such TPDO; `pdo_length`: values do not match the mapping
    can::Queued queued = can::Queued::yes;
  };
  /// New values of a TPDO.
  Written write(std::uint16_t number, std::span<const std::uint64_t> values);
  void clear() noexcept;

 private:
  struct Pdo {
    co::CobId cob_id;
    PdoSetting setting;
    std::vector<unsigned> bits;
    std::vector<std::uint64_t> values;
    std::vector<std::uint64_t> coming;  // RPDO: waits for SYNC
    std::uint64_t receptions = 0;
    std::uint8_t size = 0;          // bytes
    std::uint8_t syncs = 0;         // TPDO: since the last transmission
    bool written = false;           // TPDO: there are values
    bool wants = false;             // TPDO: an event waits
    bool counting = false;          // TPDO: the SYNC start value was there
    rt::Time free_at{};             // TPDO: end of the inhibit time
    rt::Time again_at = rt::never;  // TPDO: event timer
  };
  using Table = std::map<std::uint16_t, Pdo>;
  std::optional<Code> set(Table& table, const PdoSetting& setting);
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void run() noexcept override;
  void synchronise(std::uint8_t counter);
  void store(std::uint16_t number, Pdo& pdo, const can::Frame& frame);
  can::Queued send(Pdo& pdo) noexcept;
  void listen() noexcept;
  void arm() noexcept;

  can::Dispatcher* dispatcher_;
  Ear* ear_;
  Table rpdos_;
  Table tpdos_;
};

}  // namespace berth::serve::cia309
