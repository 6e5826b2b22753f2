#include "berth/co/sdo_client.hpp"

#include <algorithm>

#include "berth/co/cob_id.hpp"

namespace berth::co {

using sdo::Scs;

namespace {

constexpr auto full_retry = std::chrono::milliseconds(1);
constexpr const char* never_left = "the SDO request never left: nobody acknowledges, or the bus is full";

const char* why(can::Queued queued) noexcept {
  switch (queued) {
    case can::Queued::bus_off: return "the SDO request never left: bus-off";
    case can::Queued::listen_only: return "the SDO request never left: the port is listen-only";
    case can::Queued::closed: return "the SDO request never left: the port is closed";
    default: return never_left;
  }
}

}  // namespace

// ---- one transfer

SdoTransfer::~SdoTransfer() {
  if (state_ == State::idle || state_ == State::done) return;
  if (state_ == State::segments) send_abort(AbortCode::general);
  leave();
}

bool SdoTransfer::start() {
  error_.reset();
  attempts_ = 0;
  if (!node_.configured()) {
    error_ = make_error(Errc::invalid, 0, "an SDO to an unconfigured node-ID");
    return false;
  }
  state_ = State::queued;
  client_->enqueue(*this);
  return true;
}

Error SdoTransfer::make_error(Errc code, std::uint32_t detail, const char* text) const noexcept {
  return {.code = code, .node = node_.value(), .sub = ref_.sub, .index = ref_.index, .detail = detail, .text = text};
}

void SdoTransfer::prepare_initiate() noexcept {
  const auto size = data_.size();
  if (!download_) {
    sdo::put(request_, 0x40, ref_);
  } else if (size >= 1 && size <= 4) {
    sdo::put(request_, static_cast<std::uint8_t>(0x23U | ((4U - size) << 2U)), ref_);
    for (std::size_t i = 0; i < size; ++i) request_.data[4 + i] = data_[i];
  } else {
    sdo::put(request_, 0x21, ref_, static_cast<std::uint32_t>(size));
  }
}

void SdoTransfer::attempt() noexcept {
  ++attempts_;
  state_ = State::initiate;
  value_.clear();
  offset_ = indicated_ = 0;
  toggle_ = last_ = unsized_ = size_indicated_ = false;
  request_.id = sdo_request_id(node_);
  request_.size = 8;
  prepare_initiate();
  send();
}

void SdoTransfer::send() noexcept {
  give_up_ = client_->dispatcher_->executor().now() + options_.send_timeout;
  send_request();
}

void SdoTransfer::send_request() noexcept {
  window_ = false;
  auto& executor = client_->dispatcher_->executor();
  const auto queued = client_->dispatcher_->send(request_, *this);
  switch (queued) {
    case can::Queued::yes: executor.at(give_up_, *this); break;
    case can::Queued::full: executor.at(std::min(executor.now() + full_retry, give_up_), *this); break;
    default: fail_with(Errc::bus, 0, why(queued));
  }
}

void SdoTransfer::send_abort(AbortCode code) noexcept {
  static_cast<void>(client_->dispatcher_->send(sdo::make_abort(sdo_request_id(node_), ref_, code)));
}

void SdoTransfer::sent(rt::Time at) noexcept {
  window_ = true;
  auto& node = client_->node(node_);
  if (node.owed < 0xFFFF) ++node.owed;
  node.owed_until = at + client_->late_window_;
  client_->dispatcher_->executor().at(at + options_.timeout, *this);
}

void SdoTransfer::run() noexcept {
  if (state_ == State::queued) return attempt();
  if (window_) return timed_out();
  if (!pending() && client_->dispatcher_->executor().now() < give_up_) return send_request();
  if (pending()) client_->dispatcher_->withdraw(*this);
  fail_with(Errc::bus, 0, never_left);
}

void SdoTransfer::timed_out() noexcept {
  if (attempts_ <= options_.retries) return attempt();
  if (options_.abort_on_timeout) send_abort(AbortCode::timeout);
  fail_with(Errc::timeout, 0, "no answer to the SDO request");
}

bool SdoTransfer::answer(const can::Frame& frame) noexcept {
  if (!window_) return false;
  if (static_cast<Scs>(sdo::specifier(frame.data[0])) != Scs::abort) {
    return state_ == State::initiate ? initiate_answer(frame) : segment_answer(frame);
  }
  const auto object = sdo::multiplexer(frame);
  // Servers that lost the transfer (a restart) do not know the object any more.
  if (object != ref_ && !(state_ == State::segments && object == ObjectRef{})) return false;
  const auto code = sdo::abort_code(frame);
  fail_with(Errc::aborted, static_cast<std::uint32_t>(code), od::text(code));
  return true;
}

bool SdoTransfer::initiate_answer(const can::Frame& frame) noexcept {
  const auto wanted = download_ ? Scs::download : Scs::upload;
  if (static_cast<Scs>(sdo::specifier(frame.data[0])) != wanted || sdo::multiplexer(frame) != ref_) return false;
  if (!download_) {
    take_initiate(frame);
  } else if (sdo::specifier(request_.data[0]) == 1 && (request_.data[0] & 0x02U) != 0) {
    complete();
  } else {
    state_ = State::segments;
    next_segment();
  }
  return true;
}

void SdoTransfer::take_initiate(const can::Frame& frame) noexcept {
  const auto byte = frame.data[0];
  const bool expedited = (byte & 0x02U) != 0;
  const bool sized = (byte & 0x01U) != 0;
  if (expedited) {
    unsized_ = !sized;
    const std::size_t count = sized ? 4U - ((byte >> 2U) & 0x03U) : 4U;
    value_.set_expedited(frame.data.data() + 4, count);
    return complete();
  }
  size_indicated_ = sized;
  indicated_ = sized ? load_le<std::uint32_t>(frame.data.data() + 4) : 0;
  if (indicated_ > options_.longest) return refuse(AbortCode::out_of_memory, "the object is longer than allowed");
  state_ = State::segments;
  next_segment();
}

void SdoTransfer::next_segment() noexcept {
  const unsigned toggle = toggle_ ? sdo::toggle_bit : 0U;
  if (!download_) {
    sdo::put(request_, static_cast<std::uint8_t>(0x60U | toggle), {});
  } else {
    const auto piece = data_.subspan(offset_, std::min(data_.size() - offset_, sdo::segment_bytes));
    offset_ += piece.size();
    last_ = offset_ == data_.size();
    sdo::put(request_,
             static_cast<std::uint8_t>(toggle | ((sdo::segment_bytes - piece.size()) << 1U) | (last_ ? 1U : 0U)), {});
    std::ranges::copy(piece, request_.data.begin() + 1);
  }
  send();
}

bool SdoTransfer::segment_answer(const can::Frame& frame) noexcept {
  const auto command = static_cast<Scs>(sdo::specifier(frame.data[0]));
  // A second answer to the initiate (two nodes, one node-ID; a late one): not ours.
  if (command == Scs::upload || command == Scs::download) return false;
  if (command != (download_ ? Scs::download_segment : Scs::upload_segment)) {
    refuse(AbortCode::command_specifier, "the server answered with an unexpected command");
  } else if (((frame.data[0] & sdo::toggle_bit) != 0) != toggle_) {
    refuse(AbortCode::toggle_bit, "the server did not alternate the toggle bit");
  } else {
    toggle_ = !toggle_;
    take_segment(frame);
  }
  return true;
}

void SdoTransfer::take_segment(const can::Frame& frame) noexcept {
  if (download_) return last_ ? complete() : next_segment();
  const std::size_t count = sdo::segment_bytes - ((frame.data[0] >> 1U) & 0x07U);
  const bool last = (frame.data[0] & 0x01U) != 0;
  const auto total = value_.size() + count;
  if (size_indicated_ && total > indicated_) return refuse(AbortCode::length_too_high, "more bytes than indicated");
  if (total > options_.longest) return refuse(AbortCode::out_of_memory, "the object is longer than allowed");
  if (count == 0 && !last) return refuse(AbortCode::general, "an empty segment that is not the last");
  value_.append(std::span(frame.data).subspan(1, count));
  if (!last) return next_segment();
  if (size_indicated_ && total < indicated_) return refuse(AbortCode::length_too_low, "fewer bytes than indicated");
  complete();
}

void SdoTransfer::refuse(AbortCode code, const char* text) noexcept {
  send_abort(code);
  fail_with(Errc::mismatch, static_cast<std::uint32_t>(code), text);
}

void SdoTransfer::complete() noexcept {
  leave();
  finish();
}

void SdoTransfer::fail_with(Errc code, std::uint32_t detail, const char* text) noexcept {
  error_ = make_error(code, detail, text);
  leave();
  finish();
}

void SdoTransfer::leave() noexcept {
  state_ = State::done;
  window_ = false;
  cancel();
  if (pending()) client_->dispatcher_->withdraw(*this);
  client_->remove(*this);
}

// ---- the client

SdoClient::SdoClient(can::Dispatcher& dispatcher, const SdoOptions& options)
    : dispatcher_(&dispatcher), options_(options) {
  dispatcher.add(all_sdo_responses, *this);
}

SdoClient::~SdoClient() {
  for (unsigned id = 1; id <= 127; ++id) cancel(NodeId(static_cast<std::uint8_t>(id)));
}

void SdoClient::cancel(NodeId id) noexcept {
  if (!id.configured()) return;
  while (auto* transfer = node(id).first) transfer->fail_with(Errc::cancelled, 0, "the SDO transfer was cancelled");
}

void SdoClient::enqueue(SdoTransfer& transfer) noexcept {
  transfer.next_ = nullptr;
  SdoTransfer** end = &node(transfer.node_).first;
  if (*end == nullptr) {
    *end = &transfer;
    return transfer.attempt();
  }
  while (*end != nullptr) end = &(*end)->next_;
  *end = &transfer;
}

void SdoClient::remove(SdoTransfer& transfer) noexcept {
  SdoTransfer** link = &node(transfer.node_).first;
  const bool was_first = *link == &transfer;
  while (*link != nullptr && *link != &transfer) link = &(*link)->next_;
  if (*link == nullptr) return;
  *link = transfer.next_;
  if (was_first && *link != nullptr) dispatcher_->executor().post(**link);
}

void SdoClient::received(const can::Frame& frame, rt::Time at) noexcept {
  if (!sdo::well_formed(frame)) return;
  const NodeId id(static_cast<std::uint8_t>(frame.id & 0x7FU));
  Node& n = node(id);
  if (n.owed > 0 && at > n.owed_until) n.owed = 0;
  const unsigned open = n.first != nullptr && n.first->window_ ? 1 : 0;
  const bool owed = n.owed > open;
  if (n.first != nullptr && n.first->answer(frame)) {
    if (n.owed > 0) --n.owed;
  } else if (owed) {
    --n.owed;
    ++n.late;
  } else if (static_cast<Scs>(sdo::specifier(frame.data[0])) != Scs::abort ||
             sdo::abort_code(frame) != AbortCode::timeout) {  // a server may give up by itself
    ++n.surplus;
    if (observer_ != nullptr) observer_->surplus(id, frame, at);
  }
}

}  // namespace berth::co
