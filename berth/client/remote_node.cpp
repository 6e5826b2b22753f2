#include "berth/client/remote_node.hpp"

#include <fmt/format.h>

namespace berth::client {
namespace {

/// The value of 1014h in the description, or else the predefined identifier.
co::CobId emcy_cob_id(const od::Description& description, NodeId id) noexcept {
  const auto* sub = description.find(ObjectRef{0x1014, 0});
  if (sub != nullptr && sub->type == od::DataType::unsigned32 && sub->has_default) {
    const co::CobId described(static_cast<std::uint32_t>(description.default_of(*sub).resolve(sub->type, id.value())));
    if (described.valid() && described.allowed()) return described;
  }
  return co::CobId(co::emcy_id(id));
}

}  // namespace

RemoteNode::RemoteNode(Network& network, NodeId id, std::shared_ptr<const od::Description> description,
                       NodeOptions options)
    : RemoteNode(network, id, std::make_shared<const Names>(std::move(description)), options) {}

RemoteNode::RemoteNode(Network& network, NodeId id, std::shared_ptr<const Names> names, NodeOptions options)
    : NodePdos(*this),
      NodeEvents(network.executor()),
      network_(&network),
      executor_(&network.executor()),
      id_(id),
      options_(options),
      names_(std::move(names)) {
  if (options_.sdo) {
    access_.emplace(network.sdo(), id, *options_.sdo);
  } else {
    access_.emplace(network.sdo(), id);
  }
  network.add(*this);
  if (!id.configured()) return;
  co::EmcyConsumer::Observer& observer = *this;
  emcy_consumer_.emplace(network.dispatcher(), observer);
  emcy_consumer_->hear(id, emcy_cob_id(this->description(), id));
}

RemoteNode::~RemoteNode() {
  // NOLINTNEXTLINE(clang-analyzer-cplusplus.NewDelete): a deleted call leaves the ring; the analyzer cannot see it
  while (!calls_.alone()) delete static_cast<detail::CallBase*>(calls_.next());
  abandon("the node's object was destroyed");
  end_services();
  if (network_ != nullptr) network_->remove(*this);
}

void RemoteNode::network_gone() noexcept {
  abandon("the network's object was destroyed");
  end_services();
  network_ = nullptr;
}

void RemoteNode::abandon(const char* text) noexcept {
  const Failure why = failure(Errc::cancelled, text);
  while (!pending_.alone()) {
    detail::Link* const link = pending_.next();
    link->leave();
    link->abandon(why);
  }
}

void RemoteNode::end_services() noexcept {
  end_pdos();
  emcy_consumer_.reset();
  access_.reset();
  close();
}

co::SdoOptions RemoteNode::stream_options() const noexcept {
  if (options_.sdo) return *options_.sdo;
  co::SdoOptions options = network_->sdo().options();
  options.mode = co::SdoMode::automatic;
  return options;
}

void RemoteNode::emergency(NodeId node, const co::Emcy& message, rt::Time at) noexcept {
  happened(Emergency{.node = node, .at = at, .emcy = message});
}

void RemoteNode::heard(const co::HeartbeatEvent& event, rt::Time at) noexcept {
  happened(StateEvent{.node = id_, .at = at, .kind = event.kind, .state = event.state, .previous = event.previous});
}

std::optional<NmtState> RemoteNode::state() const noexcept {
  return network_ == nullptr ? std::nullopt : network_->heartbeats_.state(id_);
}

Failure RemoteNode::failure(Errc code, const char* text, ObjectRef ref, std::uint32_t detail) const {
  const Error error{
      .code = code, .node = id_.value(), .sub = ref.sub, .index = ref.index, .detail = detail, .text = text};
  return make_failure(error, ref.index == 0 ? std::string() : names_->label(ref));
}

Failure wrong_type(const Names& names, NodeId node, ObjectRef ref, od::DataType type, CppType cpp, const char* verb) {
  const Error error{.code = Errc::invalid,
                    .node = node.value(),
                    .sub = ref.sub,
                    .index = ref.index,
                    .text = "the C++ type does not fit the object's"};
  const auto known = od::name(type);
  const std::string type_name =
      known.empty() ? fmt::format("type {:04X}h", static_cast<unsigned>(type)) : std::string(known);
  return make_failure(
      error, names.label(ref),
      fmt::format("it is {}, which cannot be {} {}; use {}", type_name, verb, cpp.name, best_cpp_type(type)));
}

Complaint RemoteNode::encode(const od::SubObject* sub, od::DataType type, const Input& value, Bytes& into) const {
  const Complaint complaint = value.encode(type, into);
  if (complaint.what != nullptr || sub == nullptr || !options_.check_limits) return complaint;
  const od::Limits* const limits = od::byte_size(type) == 0 ? nullptr : description().limits(*sub);
  if (limits == nullptr) return {};
  const std::uint64_t raw = od::load(type, into.data());
  const auto beyond = [&](const od::Literal& limit, int side) {
    return limit.present() && od::compare(type, raw, limit.resolve(type, id_.value())) == side;
  };
  if (beyond(limits->low, -1)) return {"the value is below the object's low limit", od::AbortCode::value_too_low};
  if (beyond(limits->high, 1)) return {"the value is above the object's high limit", od::AbortCode::value_too_high};
  return {};
}

}  // namespace berth::client
