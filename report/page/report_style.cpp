// Style sheet of the HTML report: light and dark by the reader's scheme, printable, no fonts or files from elsewhere.
#include "duet/report/page/report_parts.h"

namespace duet {

std::string_view report_style() {
  return R"css(
:root{--bg:#fcfcfa;--panel:#fff;--ink:#1b1e22;--soft:#59616b;--line:#dfe2e6;--faint:#f1f3f5;--robot:#1f5fa8;
--human:#b9501a;--source:#8b9199;--other:#5b7d33;--bar:#1f5fa8;--null:#b9501a;
--t0:#1b1e22;--t1:#0072b2;--t2:#d55e00;--t3:#009e73;--t4:#cc79a7;--t5:#8a6d00;--t6:#56a0d9;--t7:#7a4fa3;--t8:#777d84}
@media(prefers-color-scheme:dark){:root{--bg:#131519;--panel:#1a1d22;--ink:#e8e9eb;--soft:#a5adb7;--line:#333941;
--faint:#20242a;--robot:#74aef0;--human:#f29a62;--source:#7f8791;--other:#a5cc74;--bar:#74aef0;--null:#f29a62;
--t0:#e8e9eb;--t1:#5db2e6;--t2:#ff9248;--t3:#3fcfa4;--t4:#e6a3c6;--t5:#e0c04a;--t6:#9ccbf0;--t7:#b997e0;--t8:#a0a6ad}}
*{box-sizing:border-box}
html{scroll-behavior:smooth}
body{margin:0;background:var(--bg);color:var(--ink);font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",
"Noto Sans","Liberation Sans",Arial,sans-serif}
main,header,nav ul{max-width:1360px;margin:0 auto;padding:0 28px}
header{padding-top:22px;padding-bottom:12px}
h1{font-size:17px;color:var(--soft);line-height:1.2;margin:0 0 6px;letter-spacing:-.01em}
h2{font-size:21px;margin:44px 0 8px;padding-top:8px}
h3{font-size:16px;margin:26px 0 6px}
section>p{font-size:14px;color:var(--soft)}
p{margin:6px 0;max-width:86ch}
.machine{color:var(--soft);font-size:14px}
.answer{margin:10px 0 4px}
.answer p{font-size:16px;margin:4px 0;max-width:92ch}
.answer .first{font-size:21px;line-height:1.35;font-weight:600;max-width:70ch}
.notes{margin:10px 0 0;max-width:100ch;font-size:14px}
.notes ul{margin:6px 0;padding-left:20px}
details.fold{border:0;background:none;padding:0;margin:0;border-top:1px solid var(--line)}
details.fold>summary{padding:10px 0;list-style-position:outside}
details.fold>summary h2{display:inline;margin:0;padding:0;font-size:19px}
details.fold[open]{padding-bottom:14px}
.ranked td,.ranked th{padding:6px 10px}
.ranked thead th:nth-child(-n+2),.ranked thead th:nth-child(4){text-align:left}
.ranked .ci{white-space:normal;font-weight:400}
.rate.big{font-size:18px}
.rank{color:var(--soft)}
.axis{display:block;max-width:none}
.axis .g{stroke:var(--line)}
.axis .b,.legend .b{fill:var(--bar);opacity:.16}
.axis .m,.legend .m{stroke:var(--bar);stroke-width:2}
.axis .null,.legend .null{stroke:var(--null);stroke-width:2.4;stroke-dasharray:3 2}
.e1{fill:var(--t1)}.e2{fill:var(--t2)}.e3{fill:var(--t3)}.e4{fill:var(--t4)}.e5{fill:var(--t5)}.e6{fill:var(--t6)}.e7{fill:var(--t7)}
.e8{fill:var(--t8)}
.map thead th:not(:first-child){text-align:center}
.map td{text-align:center;min-width:74px;font-weight:600;color:var(--ink)}
.map td a{color:inherit;text-decoration:none;display:block}
.map td a:hover,.map td a:focus{text-decoration:underline}
.h0{background:#8882}
.h1{background:rgb(0 114 178/.08)}.h2{background:rgb(0 114 178/.13)}.h3{background:rgb(0 114 178/.18)}.h4{background:rgb(0 114 178/.23)}
.h5{background:rgb(0 114 178/.28)}.h6{background:rgb(0 114 178/.32)}.h7{background:rgb(0 114 178/.36)}.h8{background:rgb(0 114 178/.4)}
.h9{background:rgb(0 114 178/.45)}
.replays{list-style:none;padding:0;display:flex;flex-wrap:wrap;gap:8px 12px;margin:8px 0}
.replays li{border:1px solid var(--line);border-radius:6px;background:var(--panel);padding:6px 12px}
.tall{max-height:620px;overflow:auto}
.tall thead th{position:sticky;top:0;background:var(--panel);z-index:1}
.rows td{text-align:left;white-space:nowrap}
.rows td:last-child{font-family:ui-monospace,"DejaVu Sans Mono",monospace;font-size:12px}
.finder{display:flex;flex-wrap:wrap;gap:8px;align-items:center;margin:8px 0;font-size:14px}
.finder input,.finder select{font:inherit;padding:4px 8px;border:1px solid var(--line);border-radius:6px;background:var(--panel);color:var(--ink);max-width:200px}
nav{position:sticky;top:0;z-index:2;background:var(--bg);border-bottom:1px solid var(--line)}
nav ul{display:flex;gap:22px;list-style:none;padding-top:8px;padding-bottom:8px;font-size:14px;flex-wrap:wrap}
a{color:var(--robot)}
nav a{text-decoration:none}
nav a:hover,nav a:focus{text-decoration:underline}
.scroll{overflow-x:auto;margin:10px 0;border:1px solid var(--line);border-radius:6px;background:var(--panel)}
table{border-collapse:collapse;width:100%;font-size:14px;font-variant-numeric:tabular-nums}
caption{text-align:left;padding:10px 14px 4px;color:var(--soft);font-size:14px}
th,td{padding:7px 12px;text-align:right;vertical-align:middle;border-top:1px solid var(--line);white-space:nowrap}
thead th{border-top:0;border-bottom:1px solid var(--ink);font-weight:600;vertical-align:bottom}
th.l,td.l,tbody th{text-align:left}
tbody th{font-weight:600}
tbody tr:hover{background:var(--faint)}
tr.control{color:var(--soft)}
tr.control th{font-weight:400;font-style:italic}
td.zero{color:var(--source)}
td.over{color:var(--null);font-weight:600}
section>p.warning{color:var(--ink);border-left:3px solid var(--null);padding-left:10px;font-weight:600}
.ci{color:var(--soft);font-size:12px;display:block}
.where{display:none;color:var(--soft);font-size:11.5px;font-weight:400}
.rate{font-weight:600}
.unit{color:var(--soft);font-weight:400}
.gain{color:var(--robot)}
th button{all:unset;cursor:pointer}
th button:focus-visible{outline:2px solid var(--robot);outline-offset:2px}
th button{position:relative}
th button::after{content:"";position:absolute;left:100%;color:var(--soft);font-size:10px}
th[aria-sort=ascending] button::after{content:"\25B4"}
th[aria-sort=descending] button::after{content:"\25BE"}
.bar{display:block;margin:2px 0 0 auto}
.bar .track{stroke:var(--line);stroke-width:2}
.bar .range{stroke:var(--bar);stroke-width:7;stroke-linecap:round;opacity:.35}
.bar .dot{fill:var(--bar)}
.bar .null{stroke:var(--null);stroke-width:2.4}
.control .bar .range{stroke:var(--source)}
.control .bar .dot{fill:var(--source)}
.intervals{max-width:100%;height:auto;display:block;margin:10px 0}
.intervals text{fill:var(--ink);font-size:13px}
.intervals .s{fill:var(--soft);font-size:11px}
.intervals .t{font-weight:600}
.intervals .g{stroke:var(--line)}
.intervals .b{stroke:var(--bar);stroke-width:7;stroke-linecap:round;opacity:.35}
.intervals .d{fill:var(--bar)}
.intervals .o .b{stroke:var(--source)}
.intervals .h{fill:none;stroke:var(--source);stroke-width:2}
.intervals .m{stroke:var(--null);stroke-width:3}
.intervals .r{fill:var(--null);opacity:.13}
.legend{color:var(--soft);font-size:13px;max-width:none;display:flex;gap:18px;flex-wrap:wrap;align-items:center;margin:4px 0 0}
.legend svg{vertical-align:-3px;display:inline-block;margin:0 5px 0 0}
.filter{display:flex;gap:8px;flex-wrap:wrap;margin:12px 0}
.filter button{font:inherit;font-size:14px;padding:4px 12px;border:1px solid var(--line);border-radius:99px;
background:var(--panel);color:var(--ink);cursor:pointer}
.filter button[aria-pressed=true]{background:var(--ink);color:var(--bg);border-color:var(--ink)}
.filter button:focus-visible,summary:focus-visible{outline:2px solid var(--robot);outline-offset:2px}
article.clip{border:1px solid var(--line);border-radius:6px;background:var(--panel);padding:14px 18px 16px;margin:14px 0;
break-inside:avoid}
article.clip h3{margin:0 0 4px;display:flex;gap:12px;align-items:baseline;flex-wrap:wrap}
.tag{font-size:12px;font-weight:400;color:var(--soft);border:1px solid var(--line);border-radius:99px;padding:0 9px}
.stage{display:block;width:100%;max-height:330px;margin:4px auto 8px}
.stage text{fill:var(--soft)}
.stage .frame-label{fill:var(--ink)}
.stage .ground{stroke:var(--soft);fill:none}
.stage .tick{stroke:var(--line);fill:none}
.stage g path{fill:none;stroke-linecap:round;stroke-linejoin:round}
.stage .human{stroke:var(--human)}.stage .robot{stroke:var(--robot)}.stage .source{stroke:var(--source);opacity:.5}
.stage .other{stroke:var(--other)}
.stage circle.human,.stage circle.robot,.stage circle.source,.stage circle.other{fill:var(--panel)}
.stage .far{opacity:.45}
.details{display:grid;grid-template-columns:minmax(320px,1.4fr) minmax(240px,1fr);gap:10px 26px;align-items:start}
@media(max-width:820px){.details{grid-template-columns:1fr}}
.plot{width:100%;height:auto;display:block}
.plot text{fill:var(--soft);font-size:12px}
.plot .grid{stroke:var(--line)}
.plot .axis{stroke:var(--soft)}
.plot polyline,.plot path{fill:none;stroke-width:1.8;stroke-linejoin:round}
.plot .key{fill:var(--ink)}
.plots{display:grid;grid-template-columns:repeat(auto-fill,minmax(380px,1fr));gap:14px 28px;margin:10px 0}
.plots figure{margin:0;border:1px solid var(--line);border-radius:6px;background:var(--panel);padding:10px 14px 6px}
.plots figcaption{font-size:13px;color:var(--ink);margin:0 0 4px}
table.board{font-size:13.5px}
.board th,.board td{padding:7px 8px}
.board .ci{font-size:11.5px}
.compact{font-size:13px}
.compact th,.compact td{padding:3px 8px}
.compact tbody th{font-weight:400}
details{margin:10px 0;border:1px solid var(--line);border-radius:6px;background:var(--panel);padding:8px 14px}
summary{cursor:pointer;font-weight:600}
pre{overflow:auto;font:12.5px/1.5 ui-monospace,"DejaVu Sans Mono",Menlo,Consolas,monospace;margin:8px 0;white-space:pre-wrap;
overflow-wrap:anywhere}
footer{max-width:1360px;margin:40px auto 30px;padding:0 28px;color:var(--soft);font-size:13px}
[hidden]{display:none!important}
@media(max-width:600px){main,header,nav ul{padding-left:12px;padding-right:12px}
.context{display:none}.where{display:block}
.sortable tbody th{position:sticky;left:0;background:var(--panel)}
.ranked thead{display:none}
.ranked tr{display:grid;grid-template-columns:26px 1fr 10.5em;border-top:1px solid var(--line);padding:8px 0 6px}
.ranked td,.ranked th{border:0;padding:2px 8px;text-align:left!important;position:static!important}
.ranked .plotcell{grid-column:1/4;grid-row:2}
.ranked td:nth-child(n+5){grid-row:3;font-size:12px}
.ranked td:nth-child(5)::before{content:"null "}.ranked td:nth-child(6)::before{content:"fell "}.ranked td:nth-child(7){display:none}
.ranked td:nth-child(8):not(:last-child)::before{content:"over a limit "}
.ranked td:nth-child(5){grid-column:1/3}.ranked td:nth-child(6){grid-column:1/3;grid-row:4}
.ranked td:last-child{grid-column:3;grid-row:4}
.ranked .axis{width:100%;height:auto}.answer .first{font-size:18px}details.fold>summary{list-style-position:inside}
nav{position:static}nav ul{gap:14px;flex-wrap:nowrap;overflow-x:auto;white-space:nowrap}}
@media print{nav,.filter,.finder{display:none}.tall{max-height:none}body{background:#fff;font-size:11px}.scroll{overflow:visible;border:0}
main,header,footer{max-width:none;padding:0}h2{break-after:avoid}.stage{max-height:220px}}
)css";
}

// Sorting of tables, filters and search of episodes and clips, folds that open for what leads into them and on paper.
// Without a script everything is there.
std::string_view report_script() {
  return R"js(
document.querySelectorAll('table.sortable th button').forEach(function(button){
  button.addEventListener('click',function(){
    var th=button.closest('th'),row=th.parentNode,body=th.closest('table').tBodies[0];
    var column=Array.prototype.indexOf.call(row.children,th),down=th.getAttribute('aria-sort')!=='descending';
    row.querySelectorAll('th').forEach(function(other){other.removeAttribute('aria-sort')});
    th.setAttribute('aria-sort',down?'descending':'ascending');
    var value=function(tr){var cell=tr.children[column],v=cell.dataset.v;return v===undefined?cell.textContent:v===''?-Infinity:+v};
    Array.from(body.rows).sort(function(a,b){var x=value(a),y=value(b);return (x<y?-1:x>y?1:0)*(down?-1:1)})
      .forEach(function(tr){body.appendChild(tr)});
  });
});
document.querySelectorAll('.filter').forEach(function(bar){
  bar.hidden=false;
  bar.addEventListener('click',function(event){
    var chosen=event.target.closest('button');if(!chosen)return;
    bar.querySelectorAll('button').forEach(function(b){b.setAttribute('aria-pressed',b===chosen)});
    document.querySelectorAll('article.clip').forEach(function(clip){
      clip.hidden=chosen.dataset.task!==''&&clip.dataset.task!==chosen.dataset.task});
  });
});
function unfold(id){
  var at=document.getElementById(id),fold=at&&at.querySelector('details.fold');
  if(fold)fold.open=true;
}
addEventListener('hashchange',function(){unfold(location.hash.slice(1))});
unfold(location.hash.slice(1));
document.querySelectorAll('a[href^="#"]').forEach(function(a){a.addEventListener('click',function(){unfold(a.getAttribute('href').slice(1))})});
(function(){
  var table=document.querySelector('table.rows');if(!table)return;
  var rows=Array.from(table.tBodies[0].rows),bar=document.createElement('div'),count=document.createElement('span'),selects={};
  bar.className='finder';
  var search=document.createElement('input');
  search.type='search';search.placeholder='search';search.setAttribute('aria-label','Search episodes');bar.append(search);
  Array.from(table.tHead.rows[0].cells).forEach(function(th,i){
    var name=th.textContent,values=new Set(rows.map(function(r){return r.cells[i].textContent}));
    if(name==='Clip'||name==='Key'||values.size<2)return;
    var select=document.createElement('select');select.setAttribute('aria-label',name);
    [''].concat(Array.from(values).sort()).forEach(function(v){var o=document.createElement('option');o.value=v;o.textContent=v||name+': all';select.append(o)});
    selects[name]={select:select,column:i};select.addEventListener('change',show);bar.append(select);
  });
  function show(){
    var n=0,text=search.value.toLowerCase(),on=Object.values(selects).filter(function(s){return s.select.value!==''});
    rows.forEach(function(r){
      var fits=on.every(function(s){return r.cells[s.column].textContent===s.select.value})&&(text===''||r.textContent.toLowerCase().indexOf(text)>=0);
      r.hidden=!fits;if(fits)n++});
    count.textContent=n+' of '+rows.length;
  }
  search.addEventListener('input',show);
  count.setAttribute('role','status');bar.append(count);
  table.closest('.scroll').before(bar);show();
  document.querySelectorAll('a[data-controller]').forEach(function(a){
    a.addEventListener('click',function(){
      var want={Controller:a.dataset.controller,Policy:a.dataset.policy,Perturbation:a.dataset.perturbation,Task:a.dataset.task};
      Object.keys(selects).forEach(function(name){selects[name].select.value=want[name]||''});
      search.value='';show();
    });
  });
})();
addEventListener('beforeprint',function(){document.querySelectorAll('details').forEach(function(d){d.open=true})});
)js";
}

}  // namespace duet
