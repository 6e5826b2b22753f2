/* What bench/sdo.cpp and bench/pdo.cpp do, done by CANopenNode: two nodes in one process, no bus between them, one
 * receive entry each, no other timers than those of the services. Built by bench/peers/run.
 *
 *     canopennode --trips N    expedited uploads of 1000h, client and server
 *     canopennode --pdos N     a TPDO of two UNSIGNED32: sent by one node, received and stored by the other
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OD_DEFINITION
#include "301/CO_PDO.h"
#include "301/CO_SDOclient.h"
#include "301/CO_SDOserver.h"

/* ---- the target's half of the driver: a frame waits in its sender until `deliver` */

CO_ReturnError_t CO_CANrxBufferInit(CO_CANmodule_t* can, uint16_t index, uint16_t ident, uint16_t mask, bool_t rtr,
                                    void* object, void (*callback)(void*, void*)) {
  if (index >= can->rxSize) return CO_ERROR_ILLEGAL_ARGUMENT;
  CO_CANrx_t* const entry = &can->rxArray[index];
  entry->ident = (uint16_t)((ident & 0x07FFU) | (rtr ? 0x0800U : 0U));
  entry->mask = (uint16_t)((mask & 0x07FFU) | 0x0800U);
  entry->object = object;
  entry->CANrx_callback = callback;
  return CO_ERROR_NO;
}

CO_CANtx_t* CO_CANtxBufferInit(CO_CANmodule_t* can, uint16_t index, uint16_t ident, bool_t rtr, uint8_t bytes,
                               bool_t sync) {
  if (index >= can->txSize) return NULL;
  CO_CANtx_t* const buffer = &can->txArray[index];
  buffer->ident = (uint32_t)(ident & 0x07FFU) | (rtr ? 0x0800U : 0U);
  buffer->DLC = bytes;
  buffer->bufferFull = false;
  buffer->syncFlag = sync;
  return buffer;
}

CO_ReturnError_t CO_CANsend(CO_CANmodule_t* can, CO_CANtx_t* buffer) {
  if (can->waits) return CO_ERROR_TX_OVERFLOW;
  can->frame.ident = buffer->ident;
  can->frame.DLC = buffer->DLC;
  memcpy(can->frame.data, buffer->data, 8);
  can->waits = true;
  return CO_ERROR_NO;
}

void CO_error(CO_EM_t* em, bool_t setError, const uint8_t errorBit, uint16_t errorCode, uint32_t infoCode) {
  (void)em, (void)setError, (void)errorBit, (void)errorCode, (void)infoCode;
  abort();
}

static void deliver(CO_CANmodule_t* from, CO_CANmodule_t* to) {
  if (!from->waits) return;
  from->waits = false;
  for (uint16_t i = 0; i < to->rxSize; ++i) {
    CO_CANrx_t* const entry = &to->rxArray[i];
    if (((from->frame.ident ^ entry->ident) & entry->mask) != 0) continue;
    entry->CANrx_callback(entry->object, &from->frame);
    return;
  }
}

/* ---- two dictionaries */

typedef struct {
  uint32_t type, x[2], request, response, pdo, map[2];
  uint8_t two, three, node, transmission, mapped;
  uint16_t event;
  OD_obj_var_t o1000;
  OD_obj_record_t server[3], client[4], communication[4], mapping[3];
  OD_obj_array_t array;
  OD_entry_t list[7];
  OD_t od;
  CO_CANmodule_t can;
  CO_CANrx_t rx[1];
  CO_CANtx_t tx[1];
} Node;

enum { sender_id = 5, receiver_id = 6, pdo_id = 0x185 };

static void make(Node* n, uint16_t communication) {
  n->two = 2;
  n->three = 3;
  n->request = n->response = 0x80000000U;
  n->pdo = pdo_id;
  n->transmission = 0xFF;
  n->mapped = 2;
  n->map[0] = 0x20000120;
  n->map[1] = 0x20000220;
  n->type = 0x12345678;
  n->o1000 = (OD_obj_var_t){&n->type, ODA_SDO_R | ODA_MB, 4};
  const OD_obj_record_t server[3] = {
      {&n->two, 0, ODA_SDO_R, 1}, {&n->request, 1, ODA_SDO_R | ODA_MB, 4}, {&n->response, 2, ODA_SDO_R | ODA_MB, 4}};
  memcpy(n->server, server, sizeof server);
  const OD_obj_record_t client[4] = {{&n->three, 0, ODA_SDO_R, 1},
                                     {&n->request, 1, ODA_SDO_RW | ODA_MB, 4},
                                     {&n->response, 2, ODA_SDO_RW | ODA_MB, 4},
                                     {&n->node, 3, ODA_SDO_RW, 1}};
  memcpy(n->client, client, sizeof client);
  const OD_obj_record_t parameters[4] = {{&n->two, 0, ODA_SDO_R, 1},
                                         {&n->pdo, 1, ODA_SDO_RW | ODA_MB, 4},
                                         {&n->transmission, 2, ODA_SDO_RW, 1},
                                         {&n->event, 5, ODA_SDO_RW | ODA_MB, 2}};
  memcpy(n->communication, parameters, sizeof parameters);
  const OD_obj_record_t mapping[3] = {
      {&n->mapped, 0, ODA_SDO_RW, 1}, {&n->map[0], 1, ODA_SDO_RW | ODA_MB, 4}, {&n->map[1], 2, ODA_SDO_RW | ODA_MB, 4}};
  memcpy(n->mapping, mapping, sizeof mapping);
  n->array = (OD_obj_array_t){&n->two, n->x, ODA_SDO_R, ODA_SDO_RW | ODA_TRPDO | ODA_MB, 4, 4};
  const OD_entry_t list[7] = {{0x1000, 1, ODT_VAR, &n->o1000, NULL},
                              {0x1200, 3, ODT_REC, n->server, NULL},
                              {0x1280, 4, ODT_REC, n->client, NULL},
                              {communication, 4, ODT_REC, n->communication, NULL},
                              {(uint16_t)(communication + 0x200), 3, ODT_REC, n->mapping, NULL},
                              {0x2000, 3, ODT_ARR, &n->array, NULL},
                              {0, 0, 0, NULL, NULL}};
  memcpy(n->list, list, sizeof list);
  n->od = (OD_t){6, n->list};
  n->can = (CO_CANmodule_t){.rxArray = n->rx, .rxSize = 1, .txArray = n->tx, .txSize = 1, .CANnormal = true};
}

static void must(int yes, const char* what) {
  if (yes) return;
  fprintf(stderr, "%s\n", what);
  exit(3);
}

static Node near, far;

static int trips(unsigned long count) {
  static CO_SDOserver_t server;
  static CO_SDOclient_t client;
  uint32_t info = 0;
  make(&near, 0x1800);
  make(&far, 0x1400);
  must(CO_SDOserver_init(&server, &far.od, OD_find(&far.od, 0x1200), sender_id, 1000, &far.can, 0, &far.can, 0,
                         &info) == CO_ERROR_NO,
       "no server");
  must(CO_SDOclient_init(&client, &near.od, OD_find(&near.od, 0x1280), 1, &near.can, 0, &near.can, 0, &info) ==
           CO_ERROR_NO,
       "no client");
  must(CO_SDOclient_setup(&client, 0x600 + sender_id, 0x580 + sender_id, sender_id) == CO_SDO_RT_ok_communicationEnd,
       "no channel");
  for (unsigned long i = 0; i < count; ++i) {
    CO_SDO_abortCode_t code = CO_SDO_AB_NONE;
    CO_SDO_return_t state = CO_SDOclientUploadInitiate(&client, 0x1000, 0, 1000, false);
    must(state == CO_SDO_RT_ok_communicationEnd, "not begun");
    while ((state = CO_SDOclientUpload(&client, 0, false, &code, NULL, NULL, NULL)) > 0) {
      deliver(&near.can, &far.can);
      CO_SDOserver_process(&server, true, 0, NULL);
      deliver(&far.can, &near.can);
    }
    uint32_t value = 0;
    must(state == CO_SDO_RT_ok_communicationEnd, "refused");
    must(CO_SDOclientUploadBufRead(&client, (uint8_t*)&value, sizeof value) == 4 && value == far.type, "another value");
  }
  return 0;
}

static int pdos(unsigned long count) {
  static CO_TPDO_t tpdo;
  static CO_RPDO_t rpdo;
  static CO_EM_t em;
  uint32_t info = 0;
  make(&near, 0x1800);
  make(&far, 0x1400);
  must(CO_TPDO_init(&tpdo, &near.od, &em, NULL, pdo_id, OD_find(&near.od, 0x1800), OD_find(&near.od, 0x1A00), &near.can,
                    0, &info) == CO_ERROR_NO,
       "no TPDO");
  must(CO_RPDO_init(&rpdo, &far.od, &em, NULL, pdo_id, OD_find(&far.od, 0x1400), OD_find(&far.od, 0x1600), &far.can, 0,
                    &info) == CO_ERROR_NO,
       "no RPDO");
  for (unsigned long i = 0; i < count; ++i) {
    near.x[0] = (uint32_t)i;
    CO_TPDOsendRequest(&tpdo);
    CO_TPDO_process(&tpdo, 0, NULL, true, false);
    deliver(&near.can, &far.can);
#ifdef RPDO_HAS_TIMEOUT_STATE  // since July 2026; bench/peers/run looks
    CO_RPDO_process(&rpdo, 0, NULL, NULL, true, false);
#else
    CO_RPDO_process(&rpdo, 0, NULL, true, false);
#endif
  }
  must(count == 0 || far.x[0] == (uint32_t)(count - 1), "not stored");
  return 0;
}

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const unsigned long count = strtoul(argv[2], NULL, 10);
  if (strcmp(argv[1], "--trips") == 0) return trips(count);
  return strcmp(argv[1], "--pdos") == 0 ? pdos(count) : 2;
}
