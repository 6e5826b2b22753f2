// asio/awaitable.hpp of Boost 1.74 uses std::exchange without this.
#include <utility>

#include "berth/studio/server_parts.hpp"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <poll.h>

#include <boost/asio/dispatch.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>

#include "berth/studio/batch.hpp"
#include "berth/studio/doors.hpp"
#include "berth/studio/export.hpp"
#include "berth/studio/messages.hpp"
#include "berth/studio/opened.hpp"
#include "berth/studio/pages.hpp"

namespace berth::studio {
namespace {

using Code = boost::system::error_code;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

std::string_view plain(boost::beast::string_view text) noexcept { return {text.data(), text.size()}; }

constexpr const char* policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

std::shared_ptr<Response> response(const http::request_header<>* request, http::status status, std::string body,
                                   std::string_view type) {
  auto out = std::make_shared<Response>(status, request != nullptr ? request->version() : 11);
  out->set(http::field::content_type, boost::beast::string_view(type.data(), type.size()));
  out->set("Content-Security-Policy", policy);
  out->set("X-Content-Type-Options", "nosniff");
  out->set("X-Frame-Options", "DENY");
  out->set("Referrer-Policy", "no-referrer");
  out->set("Cross-Origin-Opener-Policy", "same-origin");
  out->set("Cross-Origin-Resource-Policy", "same-origin");
  out->set(http::field::cache_control, "no-store");
  out->body() = std::move(body);
  return out;
}

std::shared_ptr<Response> words(const http::request_header<>* request, http::status status, std::string text) {
  return response(request, status, std::move(text) + "\n", "text/plain; charset=utf-8");
}

/// Exactly one field of this name: readers may choose differently between two.
std::optional<std::string_view> the_one(const Request& request, http::field name) {
  const auto range = request.equal_range(name);
  if (range.first == range.second || std::next(range.first) != range.second) return std::nullopt;
  return plain(range.first->value());
}

/// Empty: another path. Otherwise what follows the path, with its '?'.
std::optional<std::string_view> query_of(const Request& request, std::string_view path) {
  const auto target = plain(request.target());
  if (!target.starts_with(path)) return std::nullopt;
  const auto rest = target.substr(path.size());
  return rest.empty() || rest.front() == '?' ? std::optional(rest) : std::nullopt;
}

constexpr const char* another_file = "503: another file is read just now; try again when its page has it";

bool is_socket(const Request& request) { return plain(request.target()) == "/api/v1/socket"; }

bool needs_token(const Request& request, const Hall& hall) {
  if (query_of(request, "/metrics")) return !hall.mirror().open_metrics();
  return plain(request.target()).starts_with("/api/");
}

/// Null: allowed, with `role` if the request had a token.
std::shared_ptr<Response> refused(const Request& request, const Hall& hall, std::optional<command::Role>& role) {
  const auto host = the_one(request, http::field::host);
  if (!host || !hall.is_own_host(*host))
    return words(&request, http::status::forbidden,
                 fmt::format("403: this is Berth Studio at port {}, and the request means another host (Host). Use the "
                             "address that berth up printed{}",
                             hall.port(), hall.tls() ? ", or a name that its certificate is for" : ""));
  const bool from_page = is_socket(request) || request.method() == http::verb::post;
  const bool says_origin = request.count(http::field::origin) > 0;
  if (from_page || says_origin) {
    const auto origin = the_one(request, http::field::origin);
    if (!origin || !hall.is_own_origin(*origin))
      return words(&request, http::status::forbidden,
                   fmt::format("403: only pages of this server may send this (Origin: {}://{})",
                               hall.tls() ? "https" : "http", *host));
  }
  if (!needs_token(request, hall)) return nullptr;
  const auto token = is_socket(request) ? token_offered(plain(request[http::field::sec_websocket_protocol]))
                                        : bearer(plain(request[http::field::authorization]));
  role = hall.tokens().role_of(token);
  if (role) return nullptr;
  auto out = words(&request, http::status::unauthorized,
                   "401: the token is missing or not that of this start; it is in the address that berth up printed "
                   "and in the file beside its control socket");
  out->set(http::field::www_authenticate, "Bearer");
  return out;
}

// ---- HTTP ----

class Visitor final : public Client {
 public:
  Visitor(Hall& hall, Wire wire) : Client(hall, hall.next_number()), wire_(std::move(wire)) {}
  void start() {
    asio::post(hall().context(), [self = mine()] { self->wire_.secure() ? self->shake_hands() : self->read(); });
  }
  void answer(const Answer& answer) override {
    auto out = response(&parser_->get(), http::status::ok, reply_json({}, answer.reply), "application/json");
    send(std::move(out));
  }
  [[nodiscard]] Hold hold() const override { return idle_ ? Hold::idle : known_ ? Hold::stays : Hold::stranger; }
  void close() override { wire_.tcp().close(); }
  // If the client leaves before the answer, its request ends.
  void tick(bool /*rates*/) override {
    if (!asked_) return;
    pollfd end{wire_.tcp().socket().native_handle(), POLLRDHUP, 0};
    if (::poll(&end, 1, 0) > 0) leave();
  }

 private:
  std::shared_ptr<Visitor> mine() { return std::static_pointer_cast<Visitor>(shared_from_this()); }
  void shake_hands() {
    wire_.tcp().expires_after(request_time);
    wire_.handshake([self = mine()](Code error) {
      if (!error) return self->read();
      const bool plain = error.category() == asio::error::get_ssl_category() &&
                         ERR_GET_REASON(static_cast<unsigned long>(error.value())) == SSL_R_HTTP_REQUEST;
      plain ? self->tell_scheme() : self->leave();
    });
  }
  // A browser that was given http:// shows this text.
  void tell_scheme() {
    static const std::string text =
        "HTTP/1.1 400 Bad Request\r\nContent-Type: text/plain; charset=utf-8\r\nConnection: close\r\n"
        "Content-Length: 49\r\n\r\n400: Berth Studio speaks https here, not http://\n";
    asio::async_write(wire_.tcp(), asio::buffer(text), [self = mine()](Code, std::size_t) { self->leave(); });
  }
  void read() {
    parser_.emplace();
    parser_->header_limit(longest_header);
    parser_->body_limit(longest_file);
    idle_ = served_;
    wire_.tcp().expires_after(request_time);
    http::async_read_header(wire_, buffer_, *parser_,
                            [self = mine()](Code error, std::size_t) { self->taken_header(error); });
  }
  // Accepts a whole file only from clients that may send one, and only one file at a time.
  void taken_header(Code error) {
    if (error) return taken(error);
    const Request& request = parser_->get();
    const bool file = query_of(request, "/api/v1/read").has_value();
    if (file) {
      if (auto no = refused(request, hall(), role_)) return end(std::move(no));
      if (std::exchange(hall().has_file(), true))
        return end(words(&request, http::status::service_unavailable, another_file));
      has_file_ = true;
      wire_.tcp().expires_after(file_time);
    } else if (parser_->content_length().value_or(0) > longest_message) {
      return taken(http::error::body_limit);
    }
    parser_->body_limit(file ? longest_file : longest_message);
    http::async_read(wire_, buffer_, *parser_, [self = mine()](Code failed, std::size_t) { self->taken(failed); });
  }
  void taken(Code error) {
    idle_ = false;
    if (error == http::error::header_limit)
      return end(
          words(nullptr, http::status::request_header_fields_too_large, "431: a header has at most 8,192 bytes"));
    if (error == http::error::body_limit)
      return end(words(nullptr, http::status::payload_too_large,
                       "413: a request has at most 65,536 bytes, a trace file 16 MiB (in gzip it may hold more)"));
    if (error.category() == http::make_error_code(http::error::bad_method).category() &&
        error != http::error::end_of_stream && error != http::error::partial_message)
      return end(words(nullptr, http::status::bad_request, "400: this is not an HTTP request"));
    if (error) return leave();
    wire_.tcp().expires_never();
    role_.reset();
    if (auto no = refused(parser_->get(), hall(), role_)) return end(std::move(no));
    known_ = known_ || role_.has_value();
    serve();
  }
  void serve() {
    const Request& request = parser_->get();
    const auto target = plain(request.target());
    if (is_socket(request)) {
      if (!websocket::is_upgrade(request))
        return send(words(&request, http::status::upgrade_required, "426: this is a WebSocket"));
      const auto stays = mine();
      hall().leave(*this);
      return hall().enter(upgrade(hall(), std::move(wire_), parser_->release(), *role_));
    }
    if (target == "/api/v1/request") return take_request(request);
    if (const auto query = query_of(request, "/api/v1/trace")) return send_trace(request, *query);
    if (const auto query = query_of(request, "/api/v1/read")) return take_file(request, *query);
    const bool gets = request.method() == http::verb::get || request.method() == http::verb::head;
    if (!gets)
      return send(words(&request, http::status::method_not_allowed, "405: GET, HEAD; POST of /api/v1/request"));
    if (target == "/api/v1/snapshot")
      return send(response(&request, http::status::ok, hall().snapshot(*role_), "application/json"));
    if (target == "/api/v1/signals")
      return send(response(&request, http::status::ok, hall().mirror().signals(), "application/json"));
    if (query_of(request, "/metrics")) return send_metrics(request);
    const Page page = page_at(target);
    if (page.body.data() == nullptr)
      return send(words(&request, http::status::not_found, "404: there is no such page"));
    auto out = response(&request, http::status::ok, std::string(page.body), page.type);
    if (page.compressed) out->set(http::field::content_encoding, "gzip");
    if (page.lasts) out->set(http::field::cache_control, "max-age=31536000, immutable");
    send(std::move(out));
  }
  void send_metrics(const Request& request) {
    const auto exposition = exposition_for(plain(request[http::field::accept]));
    send(response(&request, http::status::ok, metrics_of(hall(), exposition), content_type(exposition)));
  }
  void take_file(const Request& request, std::string_view query) {
    if (request.method() != http::verb::post)
      return send(words(&request, http::status::method_not_allowed, "405: POST"));
    auto name = parse_name_query(query.empty() ? query : query.substr(1));
    if (!name) return send(words(&request, http::status::bad_request, "400: " + name.error()));
    opened_.emplace(std::move(*name), std::move(parser_->get().body()));
    read_file();
  }
  void read_file() {
    if (!opened_->step()) return asio::post(hall().context(), [self = mine()] { self->read_file(); });
    auto answer = opened_->answer();
    opened_.reset();
    send(answer ? response(&parser_->get(), http::status::ok, std::move(*answer), "application/json")
                : words(&parser_->get(), http::status::unprocessable_entity, "422: " + answer.error()));
  }
  void let_file_go() {
    if (std::exchange(has_file_, false)) hall().has_file() = false;
  }
  // Sends a file of any length in pieces. The next piece is made after the client took the last one.
  void send_trace(const Request& request, std::string_view query) {
    if (request.method() != http::verb::get || request.version() != 11)
      return send(words(&request, http::status::method_not_allowed, "405: GET, by HTTP/1.1"));
    const auto wanted = parse_trace_query(query.empty() ? query : query.substr(1));
    if (!wanted) return send(words(&request, http::status::bad_request, "400: " + wanted.error()));
    export_.emplace(hall().ring(), hall().mirror().buses(), *wanted);
    const auto head = response(&request, http::status::ok, {}, "application/octet-stream");
    head->set(http::field::content_disposition,
              fmt::format("attachment; filename=\"trace.{}\"", ending_of(wanted->format)));
    head->chunked(true);
    head->keep_alive(request.keep_alive());
    ends_ = !head->keep_alive();
    const auto serializer = std::make_shared<http::response_serializer<http::string_body>>(*head);
    wire_.tcp().expires_after(idle_time);
    http::async_write_header(wire_, *serializer, [self = mine(), head, serializer](Code error, std::size_t) {
      error ? self->leave() : self->next_piece();
    });
  }
  void next_piece() {
    constexpr std::size_t at_once = 4096;  // frames
    piece_.clear();
    const bool over = export_->step(at_once, piece_);
    if (piece_.empty() && !over) return asio::post(hall().context(), [self = mine()] { self->next_piece(); });
    if (piece_.empty()) return end_pieces();
    wire_.tcp().expires_after(idle_time);
    asio::async_write(wire_, http::make_chunk(asio::const_buffer(piece_.data(), piece_.size())),
                      [self = mine(), over](Code error, std::size_t) {
                        if (error) return self->leave();
                        over ? self->end_pieces() : self->next_piece();
                      });
  }
  void end_pieces() {
    export_.reset();
    asio::async_write(wire_, http::make_chunk_last(), [self = mine()](Code error, std::size_t) { self->sent(error); });
  }
  void take_request(const Request& request) {
    if (request.method() != http::verb::post)
      return send(words(&request, http::status::method_not_allowed, "405: POST"));
    auto wanted = parse_body(request.body());
    if (!wanted) return send(words(&request, http::status::bad_request, "400: " + wanted.error()));
    if (!hall().order({.client = number(), .request = std::move(*wanted), .role = *role_}))
      return send(
          words(&request, http::status::service_unavailable, "503: too many requests are under way; try again"));
    asked_ = true;
  }
  void end(std::shared_ptr<Response> out) {
    out->keep_alive(false);
    ends_ = true;
    send(std::move(out));
  }
  void send(std::shared_ptr<Response> out) {
    asked_ = false;
    let_file_go();
    out->keep_alive(!ends_ && parser_->is_done() && parser_->get().keep_alive());
    ends_ = !out->keep_alive();
    out->prepare_payload();
    if (parser_->is_done() && parser_->get().method() == http::verb::head) out->body().clear();
    wire_.tcp().expires_after(idle_time);
    http::async_write(wire_, *out, [self = mine(), out](Code error, std::size_t) { self->sent(error); });
  }
  void sent(Code error) {
    served_ = true;
    if (!error && !ends_) return read();
    if (!error && wire_.secure()) {
      wire_.tcp().expires_after(farewell_time);
      return wire_.shutdown([self = mine()](Code) { self->leave(); });
    }
    Code ignored;
    if (!error) wire_.tcp().socket().shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
    leave();
  }
  void leave() {
    let_file_go();
    hall().leave(*this);
  }

  Wire wire_;
  boost::beast::flat_buffer buffer_{longest_header + longest_message + 1024};
  std::optional<Parser> parser_;
  std::optional<command::Role> role_;  // of the request's token
  std::optional<Export> export_;       // being sent
  std::string piece_;                  // of `export_`
  std::optional<Opened> opened_;       // a file that is being read
  bool has_file_ = false;              // receiving or reading a file
  bool idle_ = false;
  bool served_ = false;  // at least one request
  bool ends_ = false;
  bool asked_ = false;  // the executor has the request
  bool known_ = false;  // it once had a valid token
};

// ---- WebSocket ----

class Watcher final : public Client {
 public:
  Watcher(Hall& hall, Wire wire, Request request, command::Role role)
      : Client(hall, hall.next_number()), socket_(std::move(wire)), request_(std::move(request)), role_(role) {}
  void start() {
    socket_.set_option(websocket::stream_base::timeout{request_time, idle_time, true});
    socket_.set_option(websocket::stream_base::decorator(
        [](websocket::response_type& out) { out.set(http::field::sec_websocket_protocol, "berth.v1"); }));
    socket_.read_message_max(longest_message);
    socket_.async_accept(request_, [self = mine()](Code error) {
      if (error) return self->leave();
      self->open_ = true;
      self->cursor_ = self->hall().ring().next();
      self->put(self->hall().snapshot(self->role_));
      self->read();
    });
  }
  void change(const Text& text) override {
    if (!open_ || behind_) return;
    if (waiting_bytes_ + text->size() > most_behind) {
      // The client gets one snapshot after what is under way, and no changes until then.
      behind_ = true;
      return drop_changes();
    }
    push({text, false, true});
  }
  void answer(const Answer& answer) override {
    if (answer.id.empty()) return put(error_json(answer.reply.error));
    if (asked_ > 0) --asked_;
    put(reply_json(answer.id, answer.reply));
  }
  void tick(bool rates) override {
    if (!open_) return;
    if (live_) send_batch();
    if (rates && waiting_bytes_ < most_behind) put(hall().rates().json(left_out_, hall().time_s()));
  }
  void close() override { socket_.next_layer().tcp().close(); }

 private:
  struct Out {
    Text text;
    bool binary = false;
    bool change = false;
  };
  std::shared_ptr<Watcher> mine() { return std::static_pointer_cast<Watcher>(shared_from_this()); }
  void read() {
    socket_.async_read(in_, [self = mine()](Code error, std::size_t) {
      if (error) return self->leave();
      const auto bytes = self->in_.data();
      const std::string text(static_cast<const char*>(bytes.data()), bytes.size());
      const bool is_text = self->socket_.got_text();
      self->in_.consume(self->in_.size());
      if (!is_text) {
        self->put(error_json("a message is text"));
      } else {
        self->take(text);
      }
      if (self->waiting_bytes_ <= most_waiting) self->read();
    });
  }
  void take(const std::string& text) {
    auto message = parse_message(text);
    if (!message) return put(error_json(message.error()));
    switch (message->kind) {
      case MessageKind::request: return ask(std::move(*message));
      case MessageKind::frames: return search(std::move(*message));
      case MessageKind::live:
        live_ = message->on;
        cursor_ = hall().ring().next();
        return;
      case MessageKind::unlock:
      case MessageKind::lock: break;
    }
    const bool unlock = message->kind == MessageKind::unlock;
    if (!hall().order({.kind = unlock ? Order::Kind::unlock : Order::Kind::lock,
                       .client = number(),
                       .minutes = message->minutes,
                       .role = role_}))
      put(error_json("too many requests are under way; try again"));
  }
  void ask(Message message) {
    const std::string id = message.id;
    const bool may = asked_ < most_asked;
    if (may && hall().order({.client = number(), .id = id, .request = std::move(message.request), .role = role_})) {
      ++asked_;
      return;
    }
    put(reply_json(id, command::refusal(3, "too many requests are under way: try again when one is done")));
  }
  // Only one search runs. A later one replaces it; the replaced one is answered with what it found so far.
  void search(Message message) {
    const bool goes_on = search_.has_value();
    if (goes_on) put(search_->answer());
    search_.emplace(hall().ring(), hall().mirror().buses(), std::move(message));
    if (!goes_on) go_on();
  }
  void go_on() {
    constexpr std::size_t at_once = 8192;
    if (!open_ || !search_) return;
    if (!search_->step(at_once)) {
      asio::post(hall().context(), [self = mine()] { self->go_on(); });
      return;
    }
    const auto text = search_->answer();
    search_.reset();
    put(text);
  }
  // At most one batch is under way. A client with a full socket gets fewer frames, and is told how many were left out.
  void send_batch() {
    const auto& ring = hall().ring();
    const auto next = ring.next();
    const auto oldest = std::max(ring.first(), next > 2 * most_in_batch ? next - 2 * most_in_batch : 0);
    if (cursor_ < oldest) {
      left_out_ += oldest - cursor_;
      cursor_ = oldest;
    }
    if (batch_under_way_ || cursor_ == next) return;
    std::string batch;
    left_out_ += append_batch(ring, cursor_, std::min<std::uint64_t>(next, cursor_ + most_in_batch), batch);
    cursor_ = std::min<std::uint64_t>(next, cursor_ + most_in_batch);
    if (batch.empty()) return;
    batch_under_way_ = true;
    push({std::make_shared<const std::string>(std::move(batch)), true, false});
  }
  void put(std::string text) { push({std::make_shared<const std::string>(std::move(text)), false, false}); }
  void push(Out out) {
    if (!open_) return;
    waiting_bytes_ += out.text->size();
    if (waiting_bytes_ > most_waiting) return leave();
    out_.push_back(std::move(out));
    if (!writing_) write();
  }
  void drop_changes() {
    // The first may be under way.
    for (auto it = out_.begin() + (writing_ ? 1 : 0); it != out_.end();) {
      if (it->change) waiting_bytes_ -= it->text->size();
      it = it->change ? out_.erase(it) : it + 1;
    }
  }
  void write() {
    if (out_.empty() && behind_) {
      behind_ = false;
      put(hall().snapshot(role_));
    }
    if (out_.empty() || writing_) return;
    writing_ = true;
    socket_.binary(out_.front().binary);
    socket_.async_write(asio::buffer(*out_.front().text), [self = mine()](Code error, std::size_t) {
      self->writing_ = false;
      if (error) return self->leave();
      if (self->out_.front().binary) self->batch_under_way_ = false;
      self->waiting_bytes_ -= self->out_.front().text->size();
      self->out_.pop_front();
      self->write();
    });
  }
  void leave() {
    if (std::exchange(left_, true)) return;
    open_ = false;
    close();
    hall().leave(*this);
  }

  websocket::stream<Wire> socket_;
  Request request_;
  command::Role role_;
  boost::beast::flat_buffer in_;
  std::deque<Out> out_;
  std::size_t waiting_bytes_ = 0;
  std::optional<Search> search_;
  std::uint64_t cursor_ = 0;    // in the live frames
  std::uint64_t left_out_ = 0;  // live frames, since the beginning
  unsigned asked_ = 0;
  bool open_ = false;
  bool left_ = false;
  bool live_ = false;
  bool writing_ = false;
  bool behind_ = false;
  bool batch_under_way_ = false;
};

}  // namespace

std::shared_ptr<Client> greet(Hall& hall, Wire wire) {
  auto visitor = std::make_shared<Visitor>(hall, std::move(wire));
  visitor->start();
  return visitor;
}

std::shared_ptr<Client> upgrade(Hall& hall, Wire wire, Request request, command::Role role) {
  auto page = std::make_shared<Watcher>(hall, std::move(wire), std::move(request), role);
  page->start();
  return page;
}

void turn_away(const Hall& hall, asio::ip::tcp::socket socket) {
  if (hall.tls() != nullptr) return;  // no TLS handshake just to refuse: a flood would exploit it
  auto held = std::make_shared<asio::ip::tcp::socket>(std::move(socket));
  static const std::string text =
      "HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain; charset=utf-8\r\nConnection: close\r\n"
      "Content-Length: 69\r\n\r\n503: sixteen clients are connected already: close one, and try again\n";
  Code ignored;
  held->non_blocking(true, ignored);
  held->write_some(asio::buffer(text), ignored);
  held->shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
}

}  // namespace berth::studio
