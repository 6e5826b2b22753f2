/// A device on a network as an application sees it: objects by name with the types of its EDS, PDOs, emergencies, NMT.
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
/// Each call has a second form with a callback at its end: `node.read<std::uint32_t>("1018:01", [](auto vendor) {});`.
/// Callbacks are called from the executor, each in a job of its own and never inside another call of this library, so
/// they may do anything: begin further accesses, destroy the node or the network. They must not throw.
///
/// Destroying the node ends what is pending, each thing once: a task that awaits is resumed, through the executor, with
/// Errc::cancelled; callbacks are destroyed and not called any more. Accesses to one node run one after the other,
/// first come, first served; those to different nodes side by side.
///
/// Before the bus is used an access is checked against the description: that the object is there, that the C++ type
/// fits (value.hpp), access type, range and limits. `NodeOptions` turns that off for devices whose EDS is wrong.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>

#include "berth/client/access.hpp"
#include "berth/client/network.hpp"
#include "berth/client/pdo.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/sdo_access.hpp"

namespace berth::client {

struct NodeOptions {
  std::optional<co::SdoOptions> sdo{};  ///< empty: the network's
  /// False: access types are not looked at, and objects that the description has not are accessed all the same, with
  /// the CANopen type of the C++ type (UNSIGNED32 for std::uint32_t).
  bool check_access = true;
  bool check_limits = true;  ///< false: only the range of the object's type counts
  /// The node is lost when no heartbeat came for so long; 0 = never, states are told all the same.
  rt::Duration heartbeat{0};
};

/// An emergency message of the node.
struct Emergency {
  NodeId node;
  rt::Time at{};  ///< end of the frame
  co::Emcy emcy;  ///< code, error register, manufacturer's bytes
  /// "current, device input side"; "error reset or no error" for 00xxh.
  [[nodiscard]] const char* text() const noexcept { return co::emcy_text(emcy.code); }
};

/// Boot-up, change of the NMT state, loss of the heartbeat.
struct StateEvent {
  NodeId node;
  rt::Time at{};
  co::HeartbeatEvent::Kind kind = co::HeartbeatEvent::Kind::started;
  NmtState state = NmtState::initialising;
  NmtState previous = NmtState::initialising;
};

class RemoteNode final : private co::EmcyConsumer::Observer, private rt::Job {
 public:
  static constexpr std::size_t kept_events = 64;  ///< emergencies and state events that wait, each

  RemoteNode(Network& network, NodeId id, std::shared_ptr<const od::Description> description, NodeOptions options = {});
  /// Shares the table of names with other nodes of the type.
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
  /// Long objects (strings, DOMAIN) without having them in memory: from a source, into a sink, which must stay until it
  /// is done. By block transfer where the device can, unless `NodeOptions::sdo` says otherwise. What came into a sink
  /// is good only when the outcome is.
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

  /// @name PDOs, by number 1..512
  /// `subscribe` and `open` read COB-ID and mapping from the device; `_as_described` takes them from the description
  /// (of a DCF: the configured values). Errors: those of reading; Errc::invalid: bit 31 of the COB-ID is set, or
  /// the number is out of range; Errc::unsupported: an MPDO; Errc::mismatch: a mapping of more than 64 bits. A second
  /// call for a number replaces the PDO: the old one ends.
  /// @{
  [[nodiscard]] rt::Task<Outcome<std::shared_ptr<Tpdo>>> subscribe(unsigned tpdo);
  [[nodiscard]] Outcome<std::shared_ptr<Tpdo>> subscribe_as_described(unsigned tpdo);
  void subscribe(unsigned tpdo, std::function<void(Outcome<std::shared_ptr<Tpdo>>)> then);
  void unsubscribe(unsigned tpdo) noexcept;
  [[nodiscard]] rt::Task<Outcome<std::shared_ptr<Rpdo>>> open(unsigned rpdo);
  [[nodiscard]] Outcome<std::shared_ptr<Rpdo>> open_as_described(unsigned rpdo);
  void open(unsigned rpdo, std::function<void(Outcome<std::shared_ptr<Rpdo>>)> then);
  /// @}

  /// @name NMT and events
  /// @{
  [[nodiscard]] Command nmt(co::NmtCommand command) { return Command(*this, command); }
  void nmt(co::NmtCommand command, std::function<void(Outcome<rt::Time>)> then) {
    call([&] { return Command(*this, command); }, std::move(then));
  }
  /// From its heartbeats; empty before the first, and while it is lost.
  [[nodiscard]] std::optional<NmtState> state() const noexcept;
  /// Replaces the callback before; empty ends it.
  void on_state(std::function<void(const StateEvent&)> call) { on_state_ = share(std::move(call)); }
  void on_emcy(std::function<void(const Emergency&)> call) { on_emcy_ = share(std::move(call)); }
  /// `Result` of the oldest event that was not taken (`Inbox::next`).
  [[nodiscard]] Inbox<StateEvent>::Next next_state(rt::Time deadline) noexcept { return states_.next(deadline); }
  [[nodiscard]] Inbox<Emergency>::Next next_emcy(rt::Time deadline) noexcept { return emergencies_.next(deadline); }
  /// @}

 private:
  friend class Network;
  friend class Tpdo;
  friend class Rpdo;
  friend class Command;
  friend class detail::Access;
  struct PdoRecord {
    co::CobId cob_id;
    std::vector<co::PdoEntry> entries;
  };
  template <class E>
  using Callback = std::shared_ptr<const std::function<void(const E&)>>;

  template <class E>
  static Callback<E> share(std::function<void(const E&)> call) {
    if (!call) return nullptr;
    return std::make_shared<const std::function<void(const E&)>>(std::move(call));
  }
  /// Calls back later, unless the callback was replaced or the node destroyed by then.
  template <class E>
  void tell(const Callback<E>& call, const E& event) {
    if (call == nullptr) return;
    events_.push_back([weak = std::weak_ptr(call), event] {
      if (const auto still = weak.lock()) (*still)(event);
    });
    executor_->post(*this);
  }
  template <class Make, class R>
  void call(const Make& make, std::function<void(R)> then) {
    auto* one = new detail::Call<decltype(make()), R>(make, std::move(then));
    one->enter(calls_);
    one->begin(*executor_);
  }
  void run() noexcept override;
  void emergency(NodeId node, const co::Emcy& message, rt::Time at) noexcept override;
  void heard(const co::HeartbeatEvent& event, rt::Time at) noexcept;
  void network_gone() noexcept;
  void abandon(const char* text) noexcept;
  void end_services() noexcept;
  [[nodiscard]] Failure failure(Errc code, const char* text, ObjectRef ref = {}, std::uint32_t detail = 0) const;
  [[nodiscard]] Failure wrong_type(ObjectRef ref, od::DataType type, CppType cpp, const char* verb) const {
    return client::wrong_type(*names_, id_, ref, type, cpp, verb);
  }
  [[nodiscard]] static Failure gone(NodeId id);
  /// `sub`: whose limits count; may be null. A complaint without a code: the C++ type does not fit.
  [[nodiscard]] Complaint encode(const od::SubObject* sub, od::DataType type, const Input& value, Bytes& into) const;
  [[nodiscard]] co::CobId emcy_cob_id() const noexcept;
  [[nodiscard]] co::SdoOptions stream_options() const noexcept;

  template <class T>
  [[nodiscard]] Read<T> raw(ObjectRef ref) {
    return Read<T>(*this, ref, Read<T>::Checked::no);
  }
  [[nodiscard]] Outcome<ObjectRef> pdo_record(co::PdoKind kind, unsigned number) const;
  [[nodiscard]] rt::Task<Outcome<PdoRecord>> read_pdo(co::PdoKind kind, unsigned number);
  [[nodiscard]] Outcome<PdoRecord> described_pdo(co::PdoKind kind, unsigned number) const;
  [[nodiscard]] Outcome<std::uint32_t> described_value(ObjectRef ref) const;
  [[nodiscard]] Outcome<std::shared_ptr<const PdoLayout>> layout(ObjectRef record, const PdoRecord& pdo) const;
  [[nodiscard]] Outcome<std::shared_ptr<Tpdo>> make_tpdo(unsigned number, const Outcome<PdoRecord>& pdo);
  [[nodiscard]] Outcome<std::shared_ptr<Rpdo>> make_rpdo(unsigned number, const Outcome<PdoRecord>& pdo);

  Network* network_;  // null: gone
  rt::Executor* executor_;
  NodeId id_;
  NodeOptions options_;
  std::shared_ptr<const Names> names_;
  std::optional<co::NodeAccess> access_;
  std::optional<co::EmcyConsumer> emcy_consumer_;
  detail::Ring pending_;  // operations
  detail::Ring calls_;    // detail::CallBase: operations with callbacks
  std::map<unsigned, std::shared_ptr<Tpdo>> tpdos_;
  std::map<unsigned, std::shared_ptr<Rpdo>> rpdos_;
  std::deque<std::function<void()>> events_;  // to be told
  Inbox<StateEvent> states_{kept_events};
  Inbox<Emergency> emergencies_{kept_events};
  Callback<StateEvent> on_state_;
  Callback<Emergency> on_emcy_;
  std::shared_ptr<const bool> alive_ = std::make_shared<const bool>(true);
};

}  // namespace berth::client
