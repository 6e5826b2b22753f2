/// Creates a remote node's PDOs: their records are read from the device or taken from the description. Part of
/// `RemoteNode`.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "berth/client/access.hpp"
#include "berth/client/pdo.hpp"
#include "berth/od/pdo_objects.hpp"
#include "berth/rt/task.hpp"

namespace berth::client {

/// PDOs by number, 1 to 512.
/// `subscribe` and `open` read COB-ID and mapping from the device; `_as_described` takes them from the description (in
/// a DCF: the configured values). Errors: those of reading; Errc::invalid: bit 31 of the COB-ID is set, or the number
/// is out of range; Errc::unsupported: an MPDO; Errc::mismatch: a mapping of more than 64 bits. A second call for a
/// number replaces the PDO: the old one ends.
class NodePdos {
 public:
  [[nodiscard]] rt::Task<Outcome<std::shared_ptr<Tpdo>>> subscribe(unsigned tpdo);
  [[nodiscard]] Outcome<std::shared_ptr<Tpdo>> subscribe_as_described(unsigned tpdo);
  void subscribe(unsigned tpdo, std::function<void(Outcome<std::shared_ptr<Tpdo>>)> then);
  void unsubscribe(unsigned tpdo) noexcept;
  [[nodiscard]] rt::Task<Outcome<std::shared_ptr<Rpdo>>> open(unsigned rpdo);
  [[nodiscard]] Outcome<std::shared_ptr<Rpdo>> open_as_described(unsigned rpdo);
  void open(unsigned rpdo, std::function<void(Outcome<std::shared_ptr<Rpdo>>)> then);

 protected:
  explicit NodePdos(RemoteNode& node) noexcept : node_(node) {}
  ~NodePdos() = default;
  NodePdos(const NodePdos&) = delete;
  NodePdos& operator=(const NodePdos&) = delete;

  /// Existing PDOs are dead from then on.
  void end_pdos() noexcept;

 private:
  /// Reads without checks against the description.
  template <class T>
  [[nodiscard]] Read<T> raw(ObjectRef ref) {
    return Read<T>(node_, ref, Read<T>::Checked::no);
  }
  [[nodiscard]] Outcome<void> readable(unsigned number) const;
  [[nodiscard]] rt::Task<Outcome<od::PdoParameters>> ask(od::PdoKind kind, unsigned number);
  [[nodiscard]] Outcome<od::PdoParameters> described(od::PdoKind kind, unsigned number) const;
  [[nodiscard]] Outcome<std::uint32_t> described_value(ObjectRef ref) const;
  [[nodiscard]] Outcome<std::shared_ptr<const PdoLayout>> layout(od::PdoKind kind, unsigned number,
                                                                 const od::PdoParameters& pdo) const;
  [[nodiscard]] Outcome<std::shared_ptr<Tpdo>> make_tpdo(unsigned number, const Outcome<od::PdoParameters>& pdo);
  [[nodiscard]] Outcome<std::shared_ptr<Rpdo>> make_rpdo(unsigned number, const Outcome<od::PdoParameters>& pdo);

  RemoteNode& node_;
  std::map<unsigned, std::shared_ptr<Tpdo>> tpdos_;
  std::map<unsigned, std::shared_ptr<Rpdo>> rpdos_;
  std::shared_ptr<const bool> alive_ = std::make_shared<const bool>(true);
};

}  // namespace berth::client
