{{- define "roomsight.labels" -}}
app.kubernetes.io/name: roomsight
app.kubernetes.io/instance: {{ .Release.Name }}
{{- end -}}

{{- define "roomsight.account" -}}
{{- .Values.serviceAccount.name | default .Release.Name -}}
{{- end -}}

{{- define "roomsight.image" -}}
{{- $tag := .Values.image.tag | default .Chart.AppVersion -}}
{{- if hasPrefix "@" $tag -}}
{{ .Values.image.repository }}{{ $tag }}
{{- else -}}
{{ .Values.image.repository }}:{{ $tag }}
{{- end -}}
{{- end -}}

{{- /* What the service reads: the file of its settings. Whole numbers stay whole, which Helm's parser makes floats of. */ -}}
{{- define "roomsight.settings" -}}
{{- range $name, $value := .Values.settings }}
{{ $name }} = {{ if kindIs "float64" $value }}{{ if eq (floor $value) $value }}{{ int64 $value }}{{ else }}{{ $value }}{{ end }}{{ else }}{{ toJson $value }}{{ end }}
{{- end }}
listen = "0.0.0.0:8080"
models = {{ toJson .Values.models }}
models_cache = "/var/cache/roomsight"
# What people teach lies in a database of one service; replicas share none.
data = ""
nats = {{ toJson .Values.nats }}
threads = {{ int .Values.threads }}
drain_timeout_ms = {{ mul (int .Values.stopping.drainSeconds) 1000 }}
{{- end -}}
