/* A ROS 2 machine on the network, as far as DDS sees one: subscribes to odom, tf and diagnostics
 * with ROS 2's type names and quality of service, and prints what it hears until it is killed. One
 * message or discovered writer a line, fields with tabs between them:
 *
 *   writer       topic type reliable|best_effort volatile|lasting history-depth
 *   odom         nanoseconds frame child position quaternion covariance[36] linear angular
 * covariance[36] transform    nanoseconds frame child translation quaternion diagnostic   level
 * name message hardware_id
 *
 * Usage: ros_listener DOMAIN INTERFACE [NAMESPACE]
 */
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "RosListener.h"
#include "dds/dds.h"

enum { TEXT_SIZE = 512, BATCH = 32, DEPTH = 100, ENTRIES = 36 };

static void print_numbers(const double* values, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    printf("\t%.17g", values[i]);
  }
}

static void print_header(const char* kind, const std_msgs_msg_dds__Header_* header,
                         const char* child) {
  printf("%s\t%" PRId64 "\t%s\t%s", kind,
         (int64_t)header->stamp_.sec_ * 1000000000 + header->stamp_.nanosec_, header->frame_id_,
         child);
}

static void print_odom(const void* sample) {
  const nav_msgs_msg_dds__Odometry_* odom = sample;
  print_header("odom", &odom->header_, odom->child_frame_id_);
  print_numbers((const double*)&odom->pose_.pose_.position_, 3);
  print_numbers((const double*)&odom->pose_.pose_.orientation_, 4);
  print_numbers(odom->pose_.covariance_, ENTRIES);
  print_numbers((const double*)&odom->twist_.twist_.linear_, 3);
  print_numbers((const double*)&odom->twist_.twist_.angular_, 3);
  print_numbers(odom->twist_.covariance_, ENTRIES);
  printf("\n");
}

static void print_tf(const void* sample) {
  const tf2_msgs_msg_dds__TFMessage_* message = sample;
  for (uint32_t i = 0; i < message->transforms_._length; ++i) {
    const geometry_msgs_msg_dds__TransformStamped_* transform = &message->transforms_._buffer[i];
    print_header("transform", &transform->header_, transform->child_frame_id_);
    print_numbers((const double*)&transform->transform_.translation_, 3);
    print_numbers((const double*)&transform->transform_.rotation_, 4);
    printf("\n");
  }
}

static void print_diagnostics(const void* sample) {
  const diagnostic_msgs_msg_dds__DiagnosticArray_* array = sample;
  for (uint32_t i = 0; i < array->status_._length; ++i) {
    const diagnostic_msgs_msg_dds__DiagnosticStatus_* status = &array->status_._buffer[i];
    printf("diagnostic\t%d\t%s\t%s\t%s\n", status->level_, status->name_, status->message_,
           status->hardware_id_);
  }
}

static void print_writer(const void* sample) {
  const dds_builtintopic_endpoint_t* writer = sample;
  dds_reliability_kind_t reliability = DDS_RELIABILITY_BEST_EFFORT;
  dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
  dds_history_kind_t history = DDS_HISTORY_KEEP_ALL;
  int32_t depth = 0;
  (void)dds_qget_reliability(writer->qos, &reliability, NULL);
  (void)dds_qget_durability(writer->qos, &durability);
  (void)dds_qget_history(writer->qos, &history, &depth);
  printf("writer\t%s\t%s\t%s\t%s\t%d\n", writer->topic_name, writer->type_name,
         reliability == DDS_RELIABILITY_RELIABLE ? "reliable" : "best_effort",
         durability == DDS_DURABILITY_VOLATILE ? "volatile" : "lasting", depth);
}

struct subscription {
  dds_entity_t reader;
  void (*print)(const void* sample);
};

static void take(const struct subscription* from) {
  void* samples[BATCH] = {NULL};
  dds_sample_info_t infos[BATCH];
  const dds_return_t count = dds_take(from->reader, samples, infos, BATCH, BATCH);
  for (dds_return_t i = 0; i < count; ++i) {
    if (infos[i].valid_data) {
      from->print(samples[i]);
    }
  }
  if (count > 0) {
    (void)dds_return_loan(from->reader, samples, count);
    (void)fflush(stdout);
  }
}

static dds_entity_t subscribe(dds_entity_t participant, const dds_topic_descriptor_t* type,
                              const char* space, const char* name) {
  char topic[TEXT_SIZE];
  (void)snprintf(topic, sizeof topic, "rt/%s%s%s", space, space[0] != '\0' ? "/" : "", name);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, DEPTH);
  const dds_entity_t reader = dds_create_reader(
      participant, dds_create_topic(participant, type, topic, NULL, NULL), qos, NULL);
  dds_delete_qos(qos);
  return reader;
}

int main(int argc, char** argv) {
  if (argc < 3) {
    return EXIT_FAILURE;
  }
  const dds_domainid_t domain = (dds_domainid_t)strtoul(argv[1], NULL, 10);
  const char* space = argc > 3 ? argv[3] : "";
  char settings[TEXT_SIZE];
  (void)snprintf(
      settings, sizeof settings,
      "<CycloneDDS><Domain id=\"any\"><General><Interfaces><NetworkInterface name=\"%s\"/>"
      "</Interfaces></General></Domain></CycloneDDS>",
      argv[2]);
  if (dds_create_domain(domain, settings) < 0) {
    return EXIT_FAILURE;
  }
  const dds_entity_t participant = dds_create_participant(domain, NULL, NULL);
  const struct subscription subscriptions[] = {
      {dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, NULL, NULL), print_writer},
      {subscribe(participant, &nav_msgs_msg_dds__Odometry__desc, space, "odom"), print_odom},
      {subscribe(participant, &tf2_msgs_msg_dds__TFMessage__desc, space, "tf"), print_tf},
      {subscribe(participant, &diagnostic_msgs_msg_dds__DiagnosticArray__desc, space,
                 "diagnostics"),
       print_diagnostics}};
  const size_t count = sizeof subscriptions / sizeof subscriptions[0];
  const dds_entity_t waitset = dds_create_waitset(participant);
  for (size_t i = 0; i < count; ++i) {
    const dds_entity_t condition = dds_create_readcondition(subscriptions[i].reader, DDS_ANY_STATE);
    if (condition < 0 || dds_waitset_attach(waitset, condition, 0) < 0) {
      return EXIT_FAILURE;
    }
  }
  while (dds_waitset_wait(waitset, NULL, 0, DDS_INFINITY) >= 0) {
    for (size_t i = 0; i < count; ++i) {
      take(&subscriptions[i]);
    }
  }
  return EXIT_FAILURE;
}
