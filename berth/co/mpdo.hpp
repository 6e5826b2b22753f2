/// Multiplex PDOs (CiA 301 §7.2.2.5): the PDO carries the object's address. The lists 1FA0h.. (scanner) and 1FD0h..
/// (dispatching) give its meaning.
#pragma once

#include <array>

#include "berth/can/frame.hpp"
#include "berth/co/pdo_context.hpp"

namespace berth::co {

namespace mpdo {

inline constexpr std::size_t size = 8;
inline constexpr std::size_t most_data = 4;  ///< bytes of a value

/// The content of a received MPDO.
struct Heard {
  bool destination = false;  ///< destination address mode; else source address mode
  std::uint8_t node = 0;     ///< the addressed node, 0 all; or the producer
  ObjectRef object;          ///< the object at that node
  std::array<std::uint8_t, most_data> data{};
  [[nodiscard]] static Heard of(const can::Frame& frame) noexcept;
};

/// An MPDO to `object` of `node`, or with 0 of all nodes.
[[nodiscard]] can::Frame make_dam(std::uint32_t key, std::uint8_t node, ObjectRef object,
                                  std::span<const std::uint8_t> data) noexcept;
[[nodiscard]] can::Frame make_sam(std::uint32_t key, NodeId producer, ObjectRef object,
                                  std::span<const std::uint8_t> data) noexcept;

/// A DAM MPDO for this device: written like a write from the network. False: there is no such object, or it refuses.
[[nodiscard]] bool write(od::Values& values, const Heard& heard) noexcept;
/// A SAM MPDO: stored at each place that the dispatching list gives.
void dispatch(od::Values& values, const Heard& heard, PdoObserver* observer, rt::Time at) noexcept;

}  // namespace mpdo

/// Objects whose SAM MPDO must wait, oldest first.
class SamProducer {
 public:
  /// True when there is a scanner list.
  [[nodiscard]] static bool wanted(const od::Description& description) noexcept;
  /// Queues the value of `object` for sending. False: the scanner list does not name it, or too many wait.
  [[nodiscard]] bool put(const od::Values& values, ObjectRef object) noexcept;
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] ObjectRef front() const noexcept { return objects_[0]; }
  void pop() noexcept;
  void clear() noexcept { count_ = 0; }

 private:
  static constexpr std::size_t room = 32;
  std::array<ObjectRef, room> objects_{};
  std::size_t count_ = 0;
};

}  // namespace berth::co
