#include "berth/client/access.hpp"

#include <fmt/format.h>

#include "berth/client/remote_node.hpp"

namespace berth::client {

namespace {

rt::Task<Result<void>> send(co::SdoClient& client, NodeId node, ObjectRef ref, co::SdoSource& source,
                            co::SdoOptions options) {
  co_return co_await client.download(node, ref.index, ref.sub, source, options);
}

rt::Task<Result<void>> fetch(co::SdoClient& client, NodeId node, ObjectRef ref, co::SdoSink& sink,
                             co::SdoOptions options) {
  co_return co_await client.upload(node, ref.index, ref.sub, sink, options);
}

}  // namespace

namespace detail {

Access::Access(RemoteNode& node, Selector selector, CppType wanted, Checked checked) : node_(&node) {
  enter(node.pending_);
  const bool checks = checked == Checked::yes && node.options_.check_access;
  const auto* sub = find(selector, checks);
  if (failure_) return;
  type_ = sub == nullptr || sub->type == od::DataType::none ? natural_type(wanted) : sub->type;
  if (!readable_as(type_, wanted)) {
    failure_ = client::wrong_type(*node.names_, node.id_, ref_, type_, wanted, "read as");
  } else {
    static_cast<void>(may(sub, false, checks));
  }
}

Access::Access(RemoteNode& node, Selector selector, const Input& value) : node_(&node), reads_(false) {
  enter(node.pending_);
  const auto* sub = find(selector, node.options_.check_access);
  if (failure_ || !may(sub, true, node.options_.check_access)) return;
  const bool described = sub != nullptr && sub->type != od::DataType::none;
  type_ = described ? sub->type : value.natural_type();
  const Complaint complaint = node.encode(described ? sub : nullptr, type_, value, data_);
  if (complaint.what == nullptr) return;
  if (complaint.code != od::AbortCode::none) {
    refuse(Errc::invalid, complaint.code, complaint.what);
  } else {
    failure_ = client::wrong_type(*node.names_, node.id_, ref_, type_, value.cpp(), "written from");
  }
}

Access::Access(RemoteNode& node, Selector selector, co::SdoSource* source, co::SdoSink* sink)
    : node_(&node), source_(source), sink_(sink), reads_(false) {
  enter(node.pending_);
  const auto* sub = find(selector, node.options_.check_access);
  if (failure_ || !may(sub, source != nullptr, node.options_.check_access)) return;
  if (sub != nullptr && od::byte_size(sub->type) != 0) {
    refuse(Errc::invalid, od::AbortCode::none, "only strings and DOMAINs can be streamed");
  }
}

bool Access::may(const od::SubObject* sub, bool write, bool checked) {
  if (!checked || sub == nullptr) return true;
  if (write && !od::writable(sub->access)) {
    refuse(Errc::invalid, od::AbortCode::read_only, "the object is read-only");
  } else if (!write && !od::readable(sub->access)) {
    refuse(Errc::invalid, od::AbortCode::write_only, "the object is write-only");
  }
  return !failure_;
}

const od::SubObject* Access::find(Selector selector, bool checked) {
  if (node_->network_ == nullptr) {
    failure_ = node_->failure(Errc::cancelled, "the network is gone");
    return nullptr;
  }
  const auto ref = node_->names_->find(selector);
  if (!ref) {
    const auto code = ref.error().kind == od::NoObject::Kind::several ? Errc::duplicate : Errc::not_found;
    const Error error{.code = code, .node = node_->id_.value(), .text = "finding an object by its name"};
    failure_ = make_failure(error, {}, ref.error().why);
    return nullptr;
  }
  ref_ = *ref;
  const auto* object = node_->description().find(ref_.index);
  const auto* sub = object == nullptr ? nullptr : node_->description().find(*object, ref_.sub);
  if (sub == nullptr && checked) {
    if (object == nullptr) {
      refuse(Errc::not_found, od::AbortCode::no_object, "the description has no such object");
    } else {
      refuse(Errc::not_found, od::AbortCode::no_sub_index, "the description has no such sub-index");
    }
  }
  return sub;
}

void Access::refuse(Errc code, od::AbortCode abort, const char* text) {
  failure_ = node_->failure(code, text, ref_, static_cast<std::uint32_t>(abort));
}

Failure Access::complain(Complaint complaint) const {
  return node_->failure(Errc::mismatch, complaint.what, ref_, static_cast<std::uint32_t>(complaint.code));
}

bool Access::start() noexcept {
  if (failure_) return false;
  bool done = false;
  if (reads_) {
    reading_ = node_->access_->read(ref_.index, ref_.sub);
    done = reading_.start(executor(), *this);
  } else {
    const auto options = node_->stream_options();
    auto& client = node_->network_->sdo();
    if (source_ != nullptr) {
      writing_ = send(client, node_->id_, ref_, *source_, options);
    } else if (sink_ != nullptr) {
      writing_ = fetch(client, node_->id_, ref_, *sink_, options);
    } else {
      writing_ = node_->access_->write(ref_.index, ref_.sub, data_);
    }
    done = writing_.start(executor(), *this);
  }
  if (done) take();
  return !done;
}

void Access::take() noexcept {
  std::optional<Error> error;
  if (reads_) {
    auto result = reading_.take();
    if (result) value_ = std::move(*result);
    if (!result) error = result.error();
  } else {
    const auto result = writing_.take();
    if (!result) error = result.error();
  }
  if (error) failure_ = make_failure(*error, node_->names_->label(ref_));
}

void Access::run() noexcept {
  take();
  finish();
}

void Access::abandon(const Failure& why) noexcept {
  cancel();
  reading_.reset();
  writing_.reset();
  failure_ = why;
  finish();
}

}  // namespace detail

Command::Command(RemoteNode& node, co::NmtCommand command) : node_(&node), command_(command) {
  enter(node.pending_);
  if (node.network_ == nullptr) failure_ = node.failure(Errc::cancelled, "the network is gone");
}

bool Command::start() noexcept {
  if (failure_) return false;
  send_.emplace(node_->network_->nmt_master(), co::NmtRequest{command_, co::NmtTarget(node_->id())});
  return !send_->begin(executor(), *this);
}

Outcome<rt::Time> Command::await_resume() const {
  if (failure_) return tl::unexpected(*failure_);
  const auto sent = send_->await_resume();
  if (sent) return *sent;
  Error error = sent.error();
  error.node = node_->id().value();
  return tl::unexpected(make_failure(error));
}

void Command::abandon(const Failure& why) noexcept {
  cancel();
  send_.reset();
  failure_ = why;
  finish();
}

}  // namespace berth::client
