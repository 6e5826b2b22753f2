/// A device on a network from an application's view: objects by name with the types of its EDS, PDOs, emergencies, NMT.
///
///     client::RemoteNode node(network, NodeId(5), file.description);      // eds::read_file("io.eds").file
///     const auto vendor = co_await node.read<std::uint32_t>("Identity object/Vendor-ID");
///     if (!vendor) co_return report(vendor.error().message);
///     const auto done = co_await node.write("Producer heartbeat time", 500);
///     const auto pdo = co_await node.subscribe(1);                        // mapping read from the device
///     client::Tpdo& tpdo = **pdo;
///     const auto sample = co_await tpdo.next(deadline);
///     const auto inputs = sample->get<std::uint8_t>("Read input 8-bit.Inputs 1 to 8");
///
/// Each call has a second form with a callback for its end: `node.read<std::uint32_t>("1018:01", [](auto vendor) {});`.
/// The executor calls callbacks, each in a job of its own and never inside another call of this library, so they may do
/// anything: begin further accesses, destroy the node or the network. They must not throw.
///
/// Destroying the node ends each pending operation once: a waiting task is resumed, through the executor, with
/// Errc::cancelled; callbacks are destroyed without a call. Accesses to one node run one after another, first come,
/// first served; those to different nodes side by side.
///
/// Before an access uses the bus, it is checked against the description: the object exists, and C++ type (value.hpp),
/// access type, range and limits fit. `NodeOptions` disables that for devices whose EDS is wrong.
#pragma once

#include <functional>
#include <memory>

#include "berth/client/access.hpp"
#include "berth/client/network.hpp"
#include "berth/client/node_events.hpp"
#include "berth/client/node_pdos.hpp"
#include "berth/co/sdo_access.hpp"

namespace berth::client {

struct NodeOptions {
  std::optional<co::SdoOptions> sdo{};  ///< empty: the network's
  /// False: access types are ignored, and undescribed objects may be accessed with the CANopen type of the C++ type
  /// (UNSIGNED32 for std::uint32_t).
  bool check_access = true;
  bool check_limits = true;  ///< false: only the range of the object's type is checked
  /// The node counts as lost after so long without heartbeat; 0 = never, but states are still reported.
  rt::Duration heartbeat{0};
};

/// `NodePdos` has its PDOs, `NodeEvents` its states and emergencies.
class RemoteNode final : public NodePdos, public NodeEvents, private co::EmcyConsumer::Observer {
 public:
  RemoteNode(Network& network, NodeId id, std::shared_ptr<const od::Description> description, NodeOptions options = {});
  /// Shares the table of names with other nodes of the same type.
  RemoteNode(Network& network, NodeId id, std::shared_ptr<const Names> names, NodeOptions options = {});
  ~RemoteNode();

  [[nodiscard]] NodeId id() const noexcept { return id_; }
  [[nodiscard]] const od::Description& description() const noexcept { return *names_->description(); }
  [[nodiscard]] const Names& names() const noexcept { return *names_; }

  /// @name Objects
  /// T: see value.hpp. `Selector`: a name, "1018:01", or an `ObjectRef`.
  /// @{
  template <class T>
  [[nodiscard]] Read<T> read(Selector object) {
    return Read<T>(*this, object);
  }
  template <class T>
  [[nodiscard]] Read<T> read(std::uint16_t index, std::uint8_t sub) {
    return Read<T>(*this, ObjectRef{index, sub});
  }
  template <class T>
  void read(Selector object, std::function<void(Outcome<T>)> then) {
    call([&] { return Read<T>(*this, object); }, std::move(then));
  }
  /// The value is copied.
  [[nodiscard]] Write write(Selector object, Input value) { return Write(*this, object, value); }
  [[nodiscard]] Write write(std::uint16_t index, std::uint8_t sub, Input value) {
    return Write(*this, ObjectRef{index, sub}, value);
  }
  void write(Selector object, Input value, std::function<void(Outcome<void>)> then) {
    call([&] { return Write(*this, object, value); }, std::move(then));
  }
  /// For long objects (strings, DOMAIN) that are not held in memory: from a source, or into a sink, which must stay
  /// until it is done. Uses block transfer if the device can, unless `NodeOptions::sdo` differs. A sink's bytes are
  /// valid only if the outcome is.
  [[nodiscard]] Stream download(Selector object, co::SdoSource& source) {
    return Stream(*this, object, &source, nullptr);
  }
  [[nodiscard]] Stream upload(Selector object, co::SdoSink& sink) { return Stream(*this, object, nullptr, &sink); }
  void download(Selector object, co::SdoSource& source, std::function<void(Outcome<void>)> then) {
    call([&] { return Stream(*this, object, &source, nullptr); }, std::move(then));
  }
  void upload(Selector object, co::SdoSink& sink, std::function<void(Outcome<void>)> then) {
    call([&] { return Stream(*this, object, nullptr, &sink); }, std::move(then));
  }
  /// @}

  /// @name NMT
  /// @{
  [[nodiscard]] Command nmt(co::NmtCommand command) { return Command(*this, command); }
  void nmt(co::NmtCommand command, std::function<void(Outcome<rt::Time>)> then) {
    call([&] { return Command(*this, command); }, std::move(then));
  }
  /// From its heartbeats; empty before the first, and while it is lost.
  [[nodiscard]] std::optional<NmtState> state() const noexcept;
  /// @}

 private:
  friend class Network;
  friend class NodePdos;
  friend class Tpdo;
  friend class Rpdo;
  friend class Command;
  friend class detail::Access;
  template <class Make, class R>
  void call(const Make& make, std::function<void(R)> then) {
    auto* one = new detail::Call<decltype(make()), R>(make, std::move(then));
    one->enter(calls_);
    one->begin(*executor_);
  }
  void emergency(NodeId node, const co::Emcy& message, rt::Time at) noexcept override;
  void heard(const co::HeartbeatEvent& event, rt::Time at) noexcept;
  void network_gone() noexcept;
  void abandon(const char* text) noexcept;
  void end_services() noexcept;
  [[nodiscard]] Failure failure(Errc code, const char* text, ObjectRef ref = {}, std::uint32_t detail = 0) const;
  /// `sub`: whose limits apply; may be null. A complaint without a code: the C++ type does not fit.
  [[nodiscard]] Complaint encode(const od::SubObject* sub, od::DataType type, const Input& value, Bytes& into) const;
  [[nodiscard]] co::SdoOptions stream_options() const noexcept;

  Network* network_;  // null: destroyed
  rt::Executor* executor_;
  NodeId id_;
  NodeOptions options_;
  std::shared_ptr<const Names> names_;
  std::optional<co::NodeAccess> access_;
  std::optional<co::EmcyConsumer> emcy_consumer_;
  detail::Ring pending_;  // operations
  detail::Ring calls_;    // detail::CallBase: operations with callbacks
};

}  // namespace berth::client
