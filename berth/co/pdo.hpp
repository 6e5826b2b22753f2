/// All PDOs of one device (CiA 301 §7.2.2, objects 1400h..1BFFh and the MPDO lists 1FA0h..1FFFh;
/// docs/protocols/cia301.md §PDO).
///
/// Up to 512 RPDOs and 512 TPDOs. The constructor allocates memory, about 100 bytes each, for those that the dictionary
/// describes (communication and mapping record). PDOs are active from `start` (NMT operational entered) to `stop`
/// (left).
///
/// Writes from the network to the records are checked. Refused, with their `od::AbortCode`:
/// - COB-ID: another value of bits 29..0 while it is and stays valid, a restricted CAN-ID (`restricted`), bits above
///   bit 10 of an 11-bit identifier (valid or not): 0609 0030. A mapping that cannot be used: its own code. Bit 30 may
///   change at any time, but see the type.
/// - Transmission type: F1h..FBh, for RPDOs also FCh and FDh, for MPDOs all but FEh and FFh: 0609 0030. A valid TPDO of
///   type FCh or FDh with bit 30 set (no remote frames) would never be sent: a write that would make one is refused
///   with 0609 0030.
/// - Inhibit time and SYNC start value while valid, a start value above 240: 0609 0030. Sub-index 4: 0609 0011.
/// - Mapping, in the order of CiA 301 §7.5.2.36 (COB-ID invalid, sub-index 0 = 0, entries, sub-index 0 = n, COB-ID
///   valid): any write while the PDO is valid, an entry while sub-index 0 is not 0: 0601 0000. Entries: see
///   `check_entry`; 0 is accepted and must not be counted. Sub-index 0: the entries are checked again; more than 64
///   bits or entries: 0604 0042; an MPDO whose type is not FEh or FFh, a second MPDO producer: 0604 0043.
/// A PDO whose defaults break these rules stays silent (`problem` gives the reason). The local side may change the
/// records too, and then calls `refresh`.
///
/// TPDO types:
/// - 00h: sent after a SYNC if `event` or `changed` came since the one before.
/// - 01h..F0h: sent after every n-th SYNC; with a SYNC start value and a counting SYNC, the SYNC that carries the start
///   value is the first.
/// - FCh: sampled at SYNC, sent at a remote frame. FDh: sampled and sent at a remote frame.
/// - FEh, FFh: sent once when operational is entered (`Options`), at `event`, `changed`, a remote frame, and when the
///   event timer (1800h:05) runs out after the last transmission.
///
/// Remote frames count only when bit 30 of the COB-ID is 0. Events within the inhibit time (FEh, FFh; measured from the
/// end of the frame on the bus) are deferred to its end and become one PDO with the values at that time. A full
/// transmit queue defers too. A PDO sampled at a SYNC is dropped if it is not on the bus when the window 1007h closes.
///
/// RPDO types: 00h..F0h are stored at the next SYNC, FEh and FFh at once. An RPDO that is shorter than mapped is not
/// processed (EMCY 8210h); of a longer one the first bytes are (8220h). Values are stored like local writes: no limits,
/// no hooks; `Observer::received` informs the application. Synchronous RPDOs that come after the window has closed are
/// dropped. The event timer 1400h:05 supervises reception: it begins with the first reception, and a write of it
/// restarts the running deadline. When it runs out, EMCY 8250h is raised, which the next reception clears. An EMCY is
/// active while any RPDO has its error; its info bytes name the first one: number of the RPDO (UNSIGNED16), length
/// received, length mapped. A good PDO ends a PDO's errors.
///
/// MPDOs (types FEh, FFh; sub-index 0 of the mapping FFh = destination address mode, FEh = source address mode). DAM:
/// sent by `send_dam`. A received one is written like a write from the network, with limits and hooks, if the object is
/// mappable into an RPDO; else EMCY 8230h. SAM: sent by `changed` of an object that the scanner list 1FA0h.. names. A
/// received one is stored where the dispatching list 1FD0h.. says, and ignored if the list does not name it. A block
/// size of 0 is an unused list entry.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "berth/co/pdo_context.hpp"
#include "berth/co/pdo_mapping.hpp"

namespace berth::co {

class Rpdo;

/// The set of PDOs: which there are, how it begins and ends, and its one timer. `Rpdo` and `Tpdo` implement one PDO,
/// `PdoRecords` the rules of its records.
class Pdos final : private od::Hook, private can::Handler, private rt::Job {
 public:
  using Observer = PdoObserver;
  struct Options {
    bool send_at_start = true;     ///< TPDOs of type FEh and FFh are sent when operational is entered
    bool detect_collision = true;  ///< EMCY 8150h when another node sends with the identifier of a TPDO
  };

  Pdos(can::Dispatcher& dispatcher, od::Values& values, ServiceOwner& owner, Options options);
  Pdos(can::Dispatcher& dispatcher, od::Values& values, ServiceOwner& owner)
      : Pdos(dispatcher, values, owner, Options()) {}
  ~Pdos();

  /// True when the dictionary describes any PDO; without one, this class does nothing.
  [[nodiscard]] bool any() const noexcept { return rpdo_count_ + context_.tpdo_count != 0; }
  void observe(Observer* observer) noexcept { context_.observer = observer; }

  /// Operational is entered, as `node` (which DAM MPDOs address).
  void start(NodeId node) noexcept;
  /// Operational is left: waiting PDOs are withdrawn, RPDOs that wait for a SYNC are forgotten, errors cleared.
  void stop() noexcept;
  [[nodiscard]] bool running() const noexcept { return running_; }
  /// The local side changed records: all PDOs begin anew. Does nothing while stopped.
  void refresh() noexcept;

  /// A SYNC came, or the device's own is on the bus (`Sync` calls it). `counter` 0 = SYNC without counter; `window` as
  /// 1007h, 0 = open until the next.
  void sync(std::uint8_t counter, rt::Time at, rt::Duration window = rt::Duration::zero()) noexcept;

  /// The application's event for TPDO `number` (1..512). False when it is not active or its type has no events.
  bool event(unsigned number) noexcept;
  /// The value of an object changed: an event for every TPDO that maps it and for the SAM MPDO that scans it. False
  /// when there is none, or when too many MPDOs wait.
  bool changed(ObjectRef object) noexcept;
  /// Sends up to 4 bytes to `object` of node 1..127 or, 0, of all nodes. `closed`: no active DAM MPDO; `full`: within
  /// the inhibit time or no room in the queue. Nothing is deferred.
  can::Queued send_dam(std::uint8_t node, ObjectRef object, std::span<const std::uint8_t> data) noexcept;

  /// True when a PDO takes part: running, valid, mapping usable.
  [[nodiscard]] bool active(PdoKind kind, unsigned number) const noexcept;
  /// Why the records of a PDO cannot be used, valid or not: the mapping's abort code, no_object when it does not exist.
  [[nodiscard]] od::AbortCode problem(PdoKind kind, unsigned number) const noexcept;
  [[nodiscard]] unsigned count(PdoKind kind) const noexcept {
    return kind == PdoKind::rpdo ? rpdo_count_ : context_.tpdo_count;
  }
  /// Bytes that this object holds, itself included.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values& values, ObjectRef ref) noexcept override;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void run() noexcept override;
  void configure() noexcept;
  void listen() noexcept;
  [[nodiscard]] std::span<Rpdo> rpdos() const noexcept;
  [[nodiscard]] std::span<Tpdo> tpdos() const noexcept;

  PdoContext context_;
  std::unique_ptr<PdoField[]> fields_;
  std::unique_ptr<Rpdo[]> rpdos_;
  std::unique_ptr<Tpdo[]> tpdos_;
  std::unique_ptr<SamProducer> sam_;  ///< only with a scanner list
  std::uint32_t field_count_ = 0;
  std::uint16_t rpdo_count_ = 0;
  Options options_;
  bool running_ = false;
  bool collided_ = false;
};

}  // namespace berth::co
